#pragma once
// Where in a file something stands, and the error that says so.

#include <memory>
#include <stdexcept>
#include <string>

namespace etendue {

/// The name of a file. Copies share the text, since a scene has several locations for each of its objects.
class FileName {
public:
    FileName() = default;
    FileName(std::string name)
        : name_(name.empty() ? nullptr : std::make_shared<const std::string>(std::move(name))) {}
    FileName(const char* name) : FileName(std::string(name)) {}

    const std::string& str() const {
        static const std::string kNone;
        return name_ ? *name_ : kNone;
    }
    bool empty() const { return !name_; }
    bool operator==(const FileName& b) const { return name_ == b.name_ || str() == b.str(); }

private:
    std::shared_ptr<const std::string> name_;
};

struct SourceLocation {
    FileName file;
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
