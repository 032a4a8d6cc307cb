#pragma once
// Where in a file something stands, and the error that says so.

#include <stdexcept>
#include <string>

namespace etendue {

struct SourceLocation {
    std::string file;
    int line = 0;  ///< Counted from 1; 0 where unknown.

    bool operator==(const SourceLocation&) const = default;
};

/// The exception thrown by readers and the scene builder. what() is "file:line: message".
class SceneError : public std::runtime_error {
public:
    SceneError(const SourceLocation& where, const std::string& message);
    const SourceLocation& where() const { return where_; }
    const std::string& message() const { return message_; }

private:
    SourceLocation where_;
    std::string message_;
};

}  // namespace etendue
