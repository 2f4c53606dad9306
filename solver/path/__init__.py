"""The path of a structure under a driver: steps, equilibrium checks, collapse."""
