"""A mission of four vehicles."""
