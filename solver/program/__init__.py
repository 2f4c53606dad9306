"""Programs of one geometry: bounds of the reaction, limit loads, and the strength and torsion of its joints."""
