"""Changes of parameters while a node runs."""

from dynamic_reconfigure.encoding import encode_config
from dynamic_reconfigure.srv import ReconfigureRequest


def reconfigure(process, node, **values):
    """Change parameters of a node as dynamic_reconfigure does."""
    return process.call(f"{node}/set_parameters", ReconfigureRequest(encode_config(values)))
