"""Following an object with a range sensor."""
