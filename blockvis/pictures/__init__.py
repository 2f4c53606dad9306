"""Pictures: stills, films and curves of a response."""
