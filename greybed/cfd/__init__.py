"""Gas on a staggered grid, and what flows with it."""
