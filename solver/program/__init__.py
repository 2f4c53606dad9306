"""Programs of an increment: stated on the model, solved, and corrected to an exact geometry."""
