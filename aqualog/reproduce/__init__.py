"""What the thesis claims, claim by claim, and what aqualog finds about it."""
