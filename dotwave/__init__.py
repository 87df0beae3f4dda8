"""The application: command line, pipeline, reports and previews."""
