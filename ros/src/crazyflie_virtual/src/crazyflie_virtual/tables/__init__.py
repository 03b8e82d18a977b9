"""What a client can list: log variables, parameters, memories."""
