"""What every command prints and writes, kept so that two versions can be compared."""
