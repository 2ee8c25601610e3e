"""Report pages and figures of campaigns."""
