"""What follows the last equilibrium: rigid-body dynamics; nothing static depends on it."""
