"""Parameters: how they are declared, checked, read and changed."""
