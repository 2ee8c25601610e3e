"""A large object that two robots hold, and a person with one hand or with two."""
