"""The ladder of model revisions: on the report, and as a page of its own while tuning runs."""
