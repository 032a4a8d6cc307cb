#pragma once

#include <memory>
#include <utility>

namespace etendue {

/// A constant value that copies share.
template <class T>
class Shared {
public:
    Shared(T value) : value_(std::make_shared<const T>(std::move(value))) {}
    operator const T&() const { return *value_; }
    const T& operator*() const { return *value_; }
    const T* operator->() const { return value_.get(); }
    bool operator==(const Shared& b) const { return value_ == b.value_ || *value_ == *b.value_; }

private:
    std::shared_ptr<const T> value_;
};

}  // namespace etendue
