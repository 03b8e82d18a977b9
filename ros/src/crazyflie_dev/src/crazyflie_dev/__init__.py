"""Tools for developing the workspace: measured flights, pictures, benchmarks."""
