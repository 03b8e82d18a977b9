"""A room from a file: shapes and their paths, ray casting, and a node that shows them."""
