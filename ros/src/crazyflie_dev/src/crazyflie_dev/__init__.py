"""Tools of those who develop the workspace: flights that are measured, pictures, test support."""
