#pragma once

#include "set_while.h"

namespace etendue::test {

/// What libpng finds no memory for: 0, nothing; 1, the state of a file that is written or read; 2, what it knows of the image.
extern std::atomic<int> png_without_memory;

struct NoMemoryForPng : SetWhile<int> {
    explicit NoMemoryForPng(int what) : SetWhile(png_without_memory, what) {}
};

}  // namespace etendue::test
