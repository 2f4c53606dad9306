"""The one step of a path: a strictly convex program over the movements of the blocks, in the plane and in space."""
