"""Files: logs as live streams, descriptions as a payload's form."""
