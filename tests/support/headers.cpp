// Nothing: the precompiled headers of all tests belong to the target of this file.
