"""What a case holds, and the assembly, interfaces and loads that are built of it."""
