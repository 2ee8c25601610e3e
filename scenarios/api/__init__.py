"""What `import handover` offers: runs, campaigns and their results, and stepping from Python."""
