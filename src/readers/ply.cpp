#include "readers/ply.h"

#include <algorithm>
#include <bit>
#include <cmath>
#include <cstring>
#include <limits>
#include <optional>
#include <utility>

#include <fmt/format.h>

#include "readers/file_bytes.h"
#include "readers/gzip.h"
#include "readers/text_cursor.h"

namespace etendue {
namespace {

static_assert(std::endian::native == std::endian::little, "binary readers assume little-endian");

enum class Type { Int8, Uint8, Int16, Uint16, Int32, Uint32, Float32, Float64 };

struct TypeInfo {
    const char *name, *sized_name;
    Type type;
    size_t bytes;
};
constexpr TypeInfo kTypes[] = {
    {"char", "int8", Type::Int8, 1},        {"uchar", "uint8", Type::Uint8, 1},
    {"short", "int16", Type::Int16, 2},     {"ushort", "uint16", Type::Uint16, 2},
    {"int", "int32", Type::Int32, 4},       {"uint", "uint32", Type::Uint32, 4},
    {"float", "float32", Type::Float32, 4}, {"double", "float64", Type::Float64, 8},
};
size_t size_of(Type type) {
    return kTypes[size_t(type)].bytes;
}
bool is_integer(Type type) {
    return type < Type::Float32;
}

struct Property {
    std::string_view name;
    Type type;
    std::optional<Type> count_type;  ///< Type of the length of a list; empty for a scalar.

    /// Smallest size of one value or list in the file.
    size_t min_bytes(bool ascii) const { return ascii ? 1 : size_of(count_type.value_or(type)); }
};

struct Element {
    std::string_view name;
    uint64_t count;
    std::vector<Property> properties;
};

enum class Format { Ascii, LittleEndian, BigEndian };

struct Header {
    Format format = Format::Ascii;
    std::vector<Element> elements;
};

std::optional<Type> type_named(std::string_view name) {
    for (const TypeInfo& t : kTypes)
        if (name == t.name || name == t.sized_name) return t.type;
    return {};
}

class HeaderParser {
public:
    explicit HeaderParser(TextCursor& in) : in_(in) {}

    /// Leaves the cursor at the first byte after the header.
    Header parse() {
        if (word() != "ply") in_.fail("not a PLY file: it does not begin with \"ply\"");
        end_line();
        bool has_format = false;
        for (;;) {
            if (in_.at_end()) in_.fail("the header has no \"end_header\"");
            const std::string_view keyword = word();
            if (keyword == "format") {
                format();
                has_format = true;
            } else if (keyword == "element") {
                element();
            } else if (keyword == "property") {
                property();
            } else if (keyword == "end_header") {
                break;
            } else if (keyword != "comment" && keyword != "obj_info" && !keyword.empty()) {
                in_.fail("unknown header line \"" + std::string(keyword.substr(0, 40)) + "\"");
            }
            end_line();
        }
        if (!has_format) in_.fail("the header has no \"format\" line");
        end_line();
        return std::move(header_);
    }

private:
    std::string_view word() {
        in_.skip_blanks();
        return in_.word();
    }
    void end_line() { in_.next_line(); }

    void format() {
        const std::string_view name = word();
        if (name == "ascii")
            header_.format = Format::Ascii;
        else if (name == "binary_little_endian")
            header_.format = Format::LittleEndian;
        else if (name == "binary_big_endian")
            header_.format = Format::BigEndian;
        else
            in_.fail("unknown format \"" + std::string(name.substr(0, 40)) +
                     "\" (known: ascii, binary_little_endian, binary_big_endian)");
        if (word() != "1.0") in_.fail("unknown version of the format (known: 1.0)");
    }
    void element() {
        const std::string_view name = word();
        in_.skip_blanks();
        const int64_t count = in_.integer("number of elements");
        if (count < 0) in_.fail(fmt::format("negative number of elements: {}", count));
        header_.elements.push_back({name, uint64_t(count), {}});
    }
    void property() {
        if (header_.elements.empty()) in_.fail("property before any element");
        Property p{};
        std::string_view type = word();
        if (type == "list") {
            p.count_type = named_type(word());
            if (!is_integer(*p.count_type)) in_.fail("the length of a list must be an integer");
            type = word();
        }
        p.type = named_type(type);
        p.name = word();
        if (p.name.empty()) in_.fail("property without a name");
        header_.elements.back().properties.push_back(p);
    }
    Type named_type(std::string_view name) const {
        const auto type = type_named(name);
        if (!type) in_.fail("unknown type \"" + std::string(name.substr(0, 40)) + "\"");
        return *type;
    }

    TextCursor& in_;
    Header header_;
};

/// The numbers of an ascii body.
class AsciiBody {
public:
    static constexpr bool kAscii = true;
    explicit AsciiBody(TextCursor in) : in_(in) {}

    size_t remaining() const { return in_.remaining(); }
    double value(Type) {
        next();
        return in_.number_or_nan("number");
    }
    int64_t integer(Type) {
        next();
        return in_.integer("integer");
    }
    void skip(Type, uint64_t count) {
        for (uint64_t i = 0; i < count; ++i) {
            next();
            in_.word();
        }
    }
    [[noreturn]] void fail(const std::string& message) const { in_.fail(message); }

private:
    void next() {
        if (!in_.skip_blank_lines()) in_.fail("the file ends early");
    }
    TextCursor in_;
};

/// The numbers of a binary body.
template <bool kSwap>
class BinaryBody {
public:
    static constexpr bool kAscii = false;
    /// The bytes of a file from `begin` on.
    BinaryBody(std::string_view bytes, size_t begin, const std::string& file)
        : first_(bytes.data()), at_(first_ + begin), end_(first_ + bytes.size()), file_(&file) {}

    size_t remaining() const { return size_t(end_ - at_); }
    double value(Type type) {
        switch (type) {
        case Type::Float32: return load<float>();
        case Type::Float64: return load<double>();
        default: return double(integer(type));
        }
    }
    int64_t integer(Type type) {
        switch (type) {
        case Type::Int8: return load<int8_t>();
        case Type::Uint8: return load<uint8_t>();
        case Type::Int16: return load<int16_t>();
        case Type::Uint16: return load<uint16_t>();
        case Type::Int32: return load<int32_t>();
        default: return load<uint32_t>();
        }
    }
    void skip(Type type, uint64_t count) {
        require(count, size_of(type));
        at_ += count * size_of(type);
    }
    /// Checks that `count` records of `bytes` bytes each come next.
    void require(uint64_t count, size_t bytes) const {
        if (count > remaining() / bytes) fail("the file ends early");
    }
    const char* position() const { return at_; }
    /// Passes over bytes that require() has checked.
    void advance(size_t bytes) { at_ += bytes; }
    /// The number of a type at any place, as a float.
    static float number_at(const char* at, Type type) {
        switch (type) {
        case Type::Float32: return load_at<float>(at);
        case Type::Float64: return float(load_at<double>(at));
        case Type::Int8: return load_at<int8_t>(at);
        case Type::Uint8: return load_at<uint8_t>(at);
        case Type::Int16: return load_at<int16_t>(at);
        case Type::Uint16: return load_at<uint16_t>(at);
        case Type::Int32: return float(load_at<int32_t>(at));
        default: return float(load_at<uint32_t>(at));
        }
    }
    /// Passes over one list of three indices below `limit`, with a length of one byte, if such a list comes next.
    bool take_triangle(uint32_t limit, MeshData::Triangle& triangle) {
        constexpr size_t kBytes = 1 + sizeof triangle;
        if (remaining() < kBytes || *at_ != 3) return false;
        for (size_t i = 0; i < 3; ++i) triangle[i] = load_at<uint32_t>(at_ + 1 + 4 * i);
        if (std::max({triangle[0], triangle[1], triangle[2]}) >= limit) return false;
        at_ += kBytes;
        return true;
    }
    [[noreturn]] void fail(const std::string& message) const {
        throw SceneError({*file_, 0}, fmt::format("{} (at byte {})", message, at_ - first_));
    }

private:
    template <class T>
    static T load_at(const char* at) {
        char raw[sizeof(T)];
        std::memcpy(raw, at, sizeof(T));
        if constexpr (kSwap) std::reverse(raw, raw + sizeof(T));
        T value;
        std::memcpy(&value, raw, sizeof(T));
        return value;
    }
    template <class T>
    T load() {
        require(1, sizeof(T));
        return load_at<T>(std::exchange(at_, at_ + sizeof(T)));
    }

    const char *first_, *at_, *end_;
    const std::string* file_;
};

/// What a property of the element "vertex" is, as the index of a float within VertexRecord.
struct VertexRecord {
    float values[11];  // x y z, nx ny nz, u v, r g b
};
constexpr int kPositionSlot = 0, kNormalSlot = 3, kUvSlot = 6, kColorSlot = 8, kNoSlot = -1;

int vertex_slot(std::string_view name) {
    constexpr const char* kNames[] = {"x", "y", "z", "nx", "ny", "nz", "u", "v", "r", "g", "b"};
    constexpr const char* kColorNames[] = {"red", "green", "blue"};
    constexpr const char* kUvNames[][2] = {
        {"s", "t"}, {"texture_u", "texture_v"}, {"texture_s", "texture_t"}};
    for (int i = 0; i < 11; ++i)
        if (name == kNames[i]) return i;
    for (int i = 0; i < 3; ++i)
        if (name == kColorNames[i]) return kColorSlot + i;
    for (const auto& pair : kUvNames)
        for (int i = 0; i < 2; ++i)
            if (name == pair[i]) return kUvSlot + i;
    return kNoSlot;
}

float unit_scale(Type type) {
    switch (type) {
    case Type::Uint8: return 1.0f / 255;
    case Type::Uint16: return 1.0f / 65535;
    default: return 1;
    }
}

template <class Body>
class BodyParser {
public:
    explicit BodyParser(Body body) : in_(body) {}

    MeshData parse(const Header& header) {
        for (const Element& e : header.elements) {
            check_count(e);
            if (e.name == "vertex")
                vertices(e);
            else if (e.name == "face")
                faces(e);
            else
                skip(e);
        }
        return std::move(mesh_);
    }

private:
    /// Checks that the rest of the file can contain the elements, before memory is allocated for them.
    void check_count(const Element& e) const {
        size_t bytes = 0;
        for (const Property& p : e.properties) bytes += p.min_bytes(Body::kAscii);
        if (bytes > 0 && e.count > in_.remaining() / bytes)
            in_.fail("the header declares " + std::to_string(e.count) + " elements \"" +
                     std::string(e.name.substr(0, 40)) + "\", more than the file can contain");
    }

    void vertices(const Element& e) {
        if (!mesh_.positions.empty()) in_.fail("more than one element \"vertex\"");
        std::vector<int> slots;
        for (const Property& p : e.properties)
            slots.push_back(p.count_type ? kNoSlot : vertex_slot(p.name));
        const auto has = [&](int first, int count) {
            for (int i = 0; i < count; ++i)
                if (std::find(slots.begin(), slots.end(), first + i) == slots.end()) return false;
            return true;
        };
        if (!has(kPositionSlot, 3)) in_.fail("the vertices have no x, y and z");
        const bool has_normals = has(kNormalSlot, 3), has_uvs = has(kUvSlot, 2),
                   has_colors = has(kColorSlot, 3);
        // Integers are fractions of their largest value.
        float color_scale = 1;
        for (size_t k = 0; k < slots.size(); ++k)
            if (slots[k] == kColorSlot) color_scale = unit_scale(e.properties[k].type);

        mesh_.positions.resize(e.count);
        if (has_normals) mesh_.normals.resize(e.count);
        if (has_uvs) mesh_.uvs.resize(e.count);
        if (has_colors) mesh_.colors.resize(e.count);
        for_records(e, slots, [&](uint64_t i, const VertexRecord& r) {
            const float* v = r.values;
            if (!std::isfinite(v[0]) || !std::isfinite(v[1]) || !std::isfinite(v[2]))
                in_.fail("position of vertex " + std::to_string(i) + " is not finite");
            mesh_.positions[i] = {v[0], v[1], v[2]};
            if (has_normals) mesh_.normals[i] = {v[3], v[4], v[5]};
            if (has_uvs) mesh_.uvs[i] = {v[6], v[7]};
            if (has_colors) mesh_.colors[i] = Vec3{v[8], v[9], v[10]} * color_scale;
        });
    }
    /// Calls `use(i, record)` for each vertex.
    template <class Use>
    void for_records(const Element& e, const std::vector<int>& slots, const Use& use) {
        VertexRecord r{};
        if constexpr (!Body::kAscii) {
            const auto is_list = [](const Property& p) { return p.count_type.has_value(); };
            if (std::none_of(e.properties.begin(), e.properties.end(), is_list))
                return for_fixed_records(e, slots, use);
        }
        for (uint64_t i = 0; i < e.count; ++i) {
            for (size_t k = 0; k < slots.size(); ++k) {
                if (slots[k] == kNoSlot)
                    skip(e.properties[k]);
                else
                    r.values[slots[k]] = float(in_.value(e.properties[k].type));
            }
            use(i, r);
        }
    }
    /// The same for binary records without lists, which all have the same size.
    template <class Use>
    void for_fixed_records(const Element& e, const std::vector<int>& slots, const Use& use) {
        struct Field {
            int slot;
            Type type;
            size_t offset;
        };
        std::vector<Field> fields;
        size_t bytes = 0;
        for (size_t k = 0; k < slots.size(); ++k) {
            if (slots[k] != kNoSlot) fields.push_back({slots[k], e.properties[k].type, bytes});
            bytes += size_of(e.properties[k].type);
        }
        in_.require(e.count, bytes);
        VertexRecord r{};
        for (uint64_t i = 0; i < e.count; ++i, in_.advance(bytes)) {
            for (const Field& f : fields)
                r.values[f.slot] = Body::number_at(in_.position() + f.offset, f.type);
            use(i, r);
        }
    }

    void faces(const Element& e) {
        const auto is_indices = [](const Property& p) {
            return p.count_type && (p.name == "vertex_indices" || p.name == "vertex_index");
        };
        const auto indices = std::find_if(e.properties.begin(), e.properties.end(), is_indices);
        if (indices == e.properties.end()) in_.fail("the faces have no list vertex_indices");
        if (!is_integer(indices->type)) in_.fail("vertex_indices must be integers");

        mesh_.triangles.reserve(mesh_.triangles.size() + e.count);
        for (uint64_t i = triangles(e); i < e.count; ++i)
            for (auto p = e.properties.begin(); p != e.properties.end(); ++p) {
                if (p == indices)
                    polygon(*p);
                else
                    skip(*p);
            }
    }
    /// Reads the faces up to the first that is not a triangle, or is invalid, in the most frequent binary layout. Returns
    /// their number.
    uint64_t triangles(const Element& e) {
        uint64_t count = 0;
        if constexpr (!Body::kAscii) {
            const Property& p = e.properties[0];
            if (e.properties.size() > 1 || size_of(*p.count_type) != 1 || size_of(p.type) != 4)
                return 0;
            const auto limit = uint32_t(
                std::min<size_t>(mesh_.positions.size(), std::numeric_limits<int32_t>::max()));
            MeshData::Triangle triangle;
            for (; count < e.count && in_.take_triangle(limit, triangle); ++count)
                mesh_.triangles.push_back(triangle);
        }
        return count;
    }
    void polygon(const Property& p) {
        const uint64_t count = list_count(p);
        if (count < 3) {
            in_.skip(p.type, count);
            ++mesh_.dropped_degenerate;
            return;
        }
        const uint32_t first = vertex_index(p.type);
        uint32_t previous = vertex_index(p.type);
        for (uint64_t i = 2; i < count; ++i) {
            const uint32_t v = vertex_index(p.type);
            mesh_.triangles.push_back({first, previous, v});
            previous = v;
        }
    }
    /// Checks the index where the vertices were read before the faces, as usual, so that the error names the line.
    /// Otherwise finish_mesh() checks it.
    uint32_t vertex_index(Type type) {
        const int64_t v = in_.integer(type);
        const size_t limit =
            mesh_.positions.empty() ? std::numeric_limits<uint32_t>::max() : mesh_.positions.size();
        if (v < 0 || uint64_t(v) >= limit)
            in_.fail("vertex index " + std::to_string(v) + " must lie in [0, " +
                     std::to_string(limit - 1) + "]");
        return uint32_t(v);
    }

    uint64_t list_count(const Property& p) {
        const int64_t count = in_.integer(*p.count_type);
        if (count < 0) in_.fail(fmt::format("negative length of a list: {}", count));
        return uint64_t(count);
    }
    void skip(const Property& p) { in_.skip(p.type, p.count_type ? list_count(p) : 1); }
    void skip(const Element& e) {
        if (e.properties.empty()) return;
        for (uint64_t i = 0; i < e.count; ++i)
            for (const Property& p : e.properties) skip(p);
    }

    Body in_;
    MeshData mesh_;
};

template <class Body>
MeshData parse_body(const Header& header, Body body) {
    return BodyParser<Body>(body).parse(header);
}

}  // namespace

MeshData parse_ply(std::string_view bytes, const std::string& name, const MeshOptions& options) {
    TextCursor in(bytes, name);
    const Header header = HeaderParser(in).parse();
    const size_t begin = bytes.size() - in.remaining();
    MeshData mesh;
    switch (header.format) {
    case Format::Ascii: mesh = parse_body(header, AsciiBody(in)); break;
    case Format::LittleEndian:
        mesh = parse_body(header, BinaryBody<false>(bytes, begin, name));
        break;
    case Format::BigEndian: mesh = parse_body(header, BinaryBody<true>(bytes, begin, name)); break;
    }
    mesh.name = name;
    finish_mesh(mesh, options, {name, 0});
    return mesh;
}

MeshData read_ply(const std::string& path, const MeshOptions& options) {
    std::string bytes = read_file_bytes(path);
    if (is_gzip(bytes)) bytes = unpack_gzip(bytes, path);
    return parse_ply(bytes, path, options);
}

}  // namespace etendue
