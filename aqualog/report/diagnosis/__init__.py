"""A diagnosis for a reader: all of it comes from the JSON document, and from residual samples for the page."""
