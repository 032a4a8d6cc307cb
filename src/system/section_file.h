#pragma once
// Files of named sections, each with a checksum, for the state of renderings.
//
// A file is 16 bytes (the mark "ETENDUE\x1a", the version of the format, 0), followed by sections. A section is a header
// of 48 bytes (name, filled up with zeros to 32 bytes; number of bytes; XXH3 of the name, that number and the bytes) and
// its bytes. An empty section "end" is the last one. Numbers are stored as in memory, little-endian.

#include <cstddef>
#include <cstdint>
#include <iosfwd>
#include <memory>
#include <optional>
#include <string>
#include <string_view>
#include <type_traits>
#include <vector>

#include "math/content_hash.h"
#include "math/padding.h"
#include "system/available_memory.h"
#include "system/output_file.h"

namespace etendue {

/// Numbers and plain structs of numbers. A bool or an enumerator in a file could have a value that the type has not.
template <class T>
concept StoredNumber =
    HasNoPadding<T> && !std::is_same_v<T, bool> &&
    (!std::is_enum_v<T> || std::is_same_v<T, std::byte>)&&!std::is_pointer_v<T> &&
    !std::is_array_v<T>;

/// Writes sections: to a file through an OutputFile, so that it is complete or not there, or to memory.
class SectionWriter {
public:
    /// Throws std::runtime_error, as commit() does, if the file cannot be written.
    explicit SectionWriter(const std::string& file);
    /// To memory.
    SectionWriter();

    /// Begins a section, to which all values up to the next one belong. Names are unique and have at most 31 characters.
    void begin(std::string_view name);
    template <StoredNumber T>
    void put(const T& value) {
        put_bytes(&value, sizeof(T));
    }
    /// The number of elements and the elements.
    template <class T>
    void put(const std::vector<T>& values) {
        static_assert(StoredNumber<T>);
        put(uint64_t(values.size()));
        put_bytes(values.data(), values.size() * sizeof(T));
    }
    void put(std::string_view text) {
        put(uint64_t(text.size()));
        put_bytes(text.data(), text.size());
    }
    void commit();
    /// The bytes of a finished file, instead of commit(), in memory.
    std::string take();

private:
    void write_file_header();
    uint64_t position() const { return (file_ ? file_->position() : 0) + buffer_.size(); }
    void put_bytes(const void* data, size_t size);
    void write(const void* data, size_t size);
    void flush();
    void finish();

    std::optional<OutputFile> file_;
    std::string buffer_;  ///< What is not written yet; everything in memory.
    std::string name_;
    uint64_t begin_ = 0, size_ = 0;  ///< Of the section: where its header is, and its bytes so far.
    ContentHash hash_;
};

/// Reads such a file. Nothing of a section is used before its checksum was verified, and no more memory is taken than
/// the file is long. All errors are std::runtime_error and name the file.
class SectionReader {
public:
    explicit SectionReader(const std::string& file);
    /// Of bytes in memory; `name` is for messages.
    SectionReader(std::string bytes, std::string name);
    ~SectionReader();
    SectionReader(SectionReader&&) noexcept;
    SectionReader& operator=(SectionReader&&) noexcept;

    /// Whether a file begins like one of these.
    static bool is_one(const std::string& file);

    const std::string& name() const { return name_; }
    bool has(std::string_view section) const { return find(section) != nullptr; }
    /// Number of bytes; 0 if there is no such section.
    uint64_t size(std::string_view section) const;
    /// The values of this section are read from now on. Throws if it is missing or damaged.
    void open(std::string_view section);
    /// Verifies every section.
    void check();
    /// Closes the file until the next open() or check(), which throw if it has changed meanwhile. For those who have many.
    void close();

    template <StoredNumber T>
    void get(T& value) {
        get_bytes(&value, sizeof(T));
    }
    template <StoredNumber T>
    T get() {
        T value;
        get(value);
        return value;
    }
    template <class T>
    void get(std::vector<T>& values) {
        static_assert(StoredNumber<T>);
        get_list(values, count(sizeof(T)));
    }
    /// A list that must have `count` elements.
    template <class T>
    void get(std::vector<T>& values, uint64_t expected, const char* what) {
        static_assert(StoredNumber<T>);
        const uint64_t found = count(sizeof(T));
        if (found != expected) fail_count(what, found, expected);
        get_list(values, found);
    }
    void get(std::string& text);
    /// Bytes of the open section that have not been read.
    uint64_t left() const { return left_; }
    /// Throws if there are any.
    void finish() const;
    /// Throws with the names of the file and of the open section.
    [[noreturn]] void fail(const std::string& why) const;

private:
    template <class List>
    void get_list(List& values, uint64_t count) {
        in_memory([&] { values.resize(size_t(count)); }, [&](const char* why) { fail(why); });
        get_bytes(values.data(), values.size() * sizeof(values[0]));
    }
    struct Section {
        std::string name;
        uint64_t begin, size, hash;

        friend bool operator==(const Section&, const Section&) = default;
    };
    void read_table();
    const Section* find(std::string_view name) const;
    void read_at(uint64_t position, void* data, size_t size);
    void verify(const Section& section);
    void open_again();
    /// Number of elements of a list, of which there are enough bytes.
    uint64_t count(size_t element);
    void get_bytes(void* data, size_t size);
    [[noreturn]] void fail_count(const char* what, uint64_t found, uint64_t expected) const;

    std::string name_, open_;
    bool is_file_;
    std::unique_ptr<std::istream> in_;  ///< nullptr after close().
    std::vector<Section> sections_;
    uint64_t left_ = 0;
};

}  // namespace etendue
