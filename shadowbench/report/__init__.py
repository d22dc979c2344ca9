"""Pictures, tables and the HTML report made from results; nothing here runs an algorithm."""
