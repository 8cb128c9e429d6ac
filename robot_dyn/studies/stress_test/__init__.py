"""What breaks first: worst configurations, limits that runs confirm, and runs judged against better ones."""
