"""The keys of case and study files, for editors as a JSON schema and for people as pages."""
