"""The numbers that the tyre trade publishes: straight and curved aquaplaning, wet braking; valid or not, set by set."""
