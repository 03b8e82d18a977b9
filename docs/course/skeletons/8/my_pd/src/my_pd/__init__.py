"""A controller: proportional and derivative, with feed-forward."""
