"""Check the installation, compilers and engines, and say what each of them is for.

Example:
  greybed doctor --out runs/doctor

Exit code 1 where something is missing that greybed cannot do without.
"""

from __future__ import annotations

import argparse


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Declare the arguments of ``greybed doctor``."""
    parser.add_argument("--out", metavar="DIR", help="also write DIR/summary.json")


def run(options: argparse.Namespace) -> int:
    """Look, print what was found, and give 1 where something needed is missing."""
    from greybed.cli.doctor_checks import examine

    groups = examine()
    for title, findings in groups.items():
        print(title)
        for finding in findings:
            print(f"  {finding.mark} {finding.name:<14} {finding.found}")
            if finding.purpose:
                print(f"      for {finding.purpose}")
            if finding.remedy:
                print(f"      {finding.remedy}")
    broken = [f.name for found in groups.values() for f in found if f.mark == "✗"]
    if broken:
        print(f"needed and not sound: {', '.join(broken)}")
    else:
        print("All that greybed needs is here; what has a dash is optional.")
    if options.out:
        from greybed.core.files import write_summary
        from greybed.core.folder_lock import locked_folder

        checks = {title: [f.as_dict() for f in found] for title, found in groups.items()}
        results = {"checks": checks, "broken": broken}
        with locked_folder(options.out) as folder:
            print(f"wrote {write_summary(folder, 'doctor', results)}")
    return 1 if broken else 0
