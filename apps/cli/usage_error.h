#pragma once

#include <stdexcept>

namespace etendue {

/// Options or arguments that are malformed, or do not go together. main() names the help of the command, and returns 2.
class UsageError : public std::runtime_error {
public:
    using std::runtime_error::runtime_error;
};

}  // namespace etendue
