"""What the commands in stages/ do between their configuration and their files."""
