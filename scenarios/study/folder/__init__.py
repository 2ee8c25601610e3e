"""What is kept of a study: folders of the study and of its sessions, tables, and the codebook that explains them."""
