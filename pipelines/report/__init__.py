"""What the reader sees. The only door to matplotlib and jinja2."""
