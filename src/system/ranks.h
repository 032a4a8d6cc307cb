#pragma once
// The processes that render one image together.

#include <algorithm>
#include <cstddef>
#include <cstdint>
#include <cstring>
#include <memory>
#include <span>
#include <string>
#include <string_view>
#include <type_traits>
#include <vector>

namespace etendue {

/// A group of processes with the numbers 0 … count()-1. An object of this class itself is a process that renders alone.
///
/// All processes must call the functions that exchange data in the same order.
class Ranks {
public:
    virtual ~Ranks() = default;
    virtual int count() const { return 1; }
    virtual int index() const { return 0; }            ///< Number of this process.
    virtual int on_this_machine() const { return 1; }  ///< How many of them run on this machine.

    /// Elements begins[r] … begins[r+1]-1 of `data` are those of process r; afterwards, every process has all of them.
    /// Elements have `size` bytes.
    virtual void share(void* /*data*/, size_t /*size*/,
                       std::span<const uint64_t> /*begins*/) const {}
    /// Each of the processes 0 … senders-1 has elements in `from`, of which process r gets begins[r] … begins[r+1]-1. It
    /// finds those of all senders, one after another, in `to`.
    virtual void distribute(const void* from, int senders, size_t size,
                            std::span<const uint64_t> begins, void* to) const {
        if (senders > 0)
            std::copy_n(static_cast<const std::byte*>(from), size_t(begins[1] - begins[0]) * size,
                        static_cast<std::byte*>(to));
    }
    /// Sets `bytes` to those of process `from`.
    virtual void broadcast(std::vector<std::byte>& /*bytes*/, int /*from*/) const {}
    /// What every process says.
    virtual std::vector<std::string> gather(std::string_view said) const {
        return {std::string(said)};
    }

    /// The value in process 0.
    template <class T>
    T of_first(T value) const {
        static_assert(std::is_trivially_copyable_v<T>);
        std::vector<std::byte> bytes(sizeof value);
        std::memcpy(bytes.data(), &value, sizeof value);
        broadcast(bytes, 0);
        std::memcpy(&value, bytes.data(), sizeof value);
        return value;
    }
    /// Whether this is so in any process.
    bool any(bool is_so) const {
        bool any = false;
        for (const uint8_t b : gather_values(uint8_t(is_so))) any |= b != 0;
        return any;
    }
    /// The value in every process.
    template <class T>
    std::vector<T> gather_values(const T& value) const {
        static_assert(std::is_trivially_copyable_v<T>);
        std::vector<T> values;
        for (const std::string& bytes :
             gather({reinterpret_cast<const char*>(&value), sizeof value}))
            std::memcpy(&values.emplace_back(), bytes.data(), sizeof(T));
        return values;
    }
};

inline const Ranks kAlone;

/// The processes that mpirun or the like has started together, if there are several and the program was built with MPI. To be
/// called once. The object must live until all of them have finished their work; if one ends before, they are all ended.
std::unique_ptr<const Ranks> join_ranks();

/// Says that mpirun, srun or the like has started several processes which do not belong to `joined` (of join_ranks()), but
/// each render alone, and why. Empty if that is not so, and in all of them but the first.
std::string warning_of_strangers(const Ranks& joined);

}  // namespace etendue
