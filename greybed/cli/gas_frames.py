"""Frames of particles in a gas: those of the particles, and the gas beside them."""

from __future__ import annotations

from typing import Any

from greybed.cli.simulate_particles import Frames


class GasFrames(Frames):
    """Frames of both; the gas's wait in parts of their own and become one VTKHDF file."""

    run: Any

    def clear(self) -> None:
        """Take away frames of an older run in the same folder."""
        super().clear()
        for old in self.folder.glob("gas_frame_*"):
            old.unlink()

    def write(self) -> None:
        """Write the frame of now."""
        super().write()
        if self.every is None:
            return
        from greybed.core.writers.vtkhdf_grid import write_grid_part

        sim = self.run.simulation
        part = self.folder / f"gas_frame_{sim.steps:010d}.npz"
        write_grid_part(part, self.run.gas_fields(), sim.time)

    def finish(self) -> None:
        """Write the collections, the film, and a picture of the gas at the end."""
        super().finish()
        from greybed.core.writers.vtkhdf_grid import join_grid_parts
        from greybed.report.fields import field_picture

        grid, target = self.run.gas.grid, self.folder.parent
        parts = sorted(self.folder.glob("gas_frame_*.npz"))
        if parts:
            join_grid_parts(
                target / "gas_frames.vtkhdf", parts, grid.cells, grid.lower, grid.spacing
            )
        for part in parts:
            part.unlink()
        pictures: dict[str, tuple[str, tuple[float, float] | None]] = {
            "final_gas": ("void fraction [-]", (0.35, 1.0))
        }
        fields = self.run.gas_fields()
        if "temperature [K]" in fields:
            pictures["final_gas_temperature"] = ("temperature [K]", None)
        for picture, (name, limits) in pictures.items():
            field_picture(
                target / f"{picture}.png", fields[name], grid.lower, grid.upper, name, limits,
                f"{self.run.simulation.time:.3f} s",
            )  # fmt: skip
