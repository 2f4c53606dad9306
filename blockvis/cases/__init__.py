"""What a case holds, and the assembly, interfaces and loads that are built of it.

``source`` is the case file, and ``where`` file, table and key: both are for messages.
"""
