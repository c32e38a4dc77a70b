"""Check whether the signals of a drive fit each other, before any number is made of them."""
