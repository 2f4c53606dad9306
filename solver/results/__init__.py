"""What analyses give back."""
