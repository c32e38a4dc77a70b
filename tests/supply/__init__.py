"""What aqualog is built on: versions and licences."""
