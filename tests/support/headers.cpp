// Empty: the target of this file owns the precompiled headers of all tests.
