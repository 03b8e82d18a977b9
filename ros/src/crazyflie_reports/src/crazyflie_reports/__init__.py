"""Records of flights, reports and pictures of them."""
