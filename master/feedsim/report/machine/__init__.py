"""A machine's structure: its figures, pictures of it and of its modes, the page that holds them."""
