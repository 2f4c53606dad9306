"""The page that plays a response, alone and in a notebook."""
