"""A room from a file: shapes and their paths, rays that meet them, a node that shows them."""
