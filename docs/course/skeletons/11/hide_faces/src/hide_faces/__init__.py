"""Images in which faces are blurred."""
