#include "readers/ply.h"

#include <algorithm>
#include <array>
#include <bit>
#include <cmath>
#include <cstring>
#include <limits>
#include <optional>
#include <type_traits>
#include <utility>

#include <fmt/format.h>

#include "math/hash.h"
#include "readers/file_bytes.h"
#include "readers/gzip.h"
#include "readers/key_table.h"
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
        TextCursor of_line_feeds = in_;
        const bool has_line_feeds = !of_line_feeds.skip_char('\r') || of_line_feeds.at_char('\n');
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
        // Binary data may begin with either of the two characters.
        in_.next_line(has_line_feeds ? '\n' : '\r');
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
    float values[14];  // x y z, nx ny nz, u v, r g b a, second u v
};
constexpr int kPositionSlot = 0, kNormalSlot = 3, kUvSlot = 6, kColorSlot = 8, kAlphaSlot = 11,
              kSecondUvSlot = 12, kNoSlot = -1;

int vertex_slot(std::string_view name) {
    constexpr const char* kNames[] = {"x", "y", "z", "nx", "ny", "nz",       "u",
                                      "v", "r", "g", "b",  "a",  "second_u", "second_v"};
    constexpr const char* kColorNames[] = {"red", "green", "blue"};
    constexpr const char* kUvNames[][2] = {
        {"s", "t"}, {"texture_u", "texture_v"}, {"texture_s", "texture_t"}};
    for (int i = 0; i < int(std::size(kNames)); ++i)
        if (name == kNames[i]) return i;
    if (name == "alpha") return kAlphaSlot;
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

/// Names of per-vertex and per-face data that are no part of what a mesh looks like.
bool is_measurement(std::string_view name) {
    constexpr const char* kNames[] = {"flags",   "quality", "confidence", "intensity", "radius",
                                      "density", "value",   "id",         "object_id", "label"};
    return std::any_of(std::begin(kNames), std::end(kNames),
                       [&](const char* known) { return name == known; });
}

/// What a corner of a face has of its own; vertices are split where their corners differ.
struct CornerData {
    Vec2 uv;
    Vec3 color;
    bool operator==(const CornerData&) const = default;
};

/// Gives each distinct pair of a vertex and the data of a corner a vertex of its own. `corners`: three per triangle.
void split_vertices(MeshData& mesh, const std::vector<CornerData>& corners, bool has_uvs,
                    bool has_colors) {
    struct Key {
        uint32_t vertex;
        CornerData data;
        bool operator==(const Key&) const = default;
    };
    struct Hash {
        uint64_t operator()(const Key& k) const {
            uint64_t hash = k.vertex;
            for (const float x :
                 {k.data.uv.x, k.data.uv.y, k.data.color.x, k.data.color.y, k.data.color.z})
                hash = hash_combine(hash, std::bit_cast<uint32_t>(x));
            return hash;
        }
    };
    KeyTable<Key, Hash> table;
    size_t corner = 0;
    for (MeshData::Triangle& t : mesh.triangles)
        for (uint32_t& v : t) v = table.index_of({v, corners[corner++]});
    for_each_vertex_array(mesh, [&](const char*, auto& values) {
        if (values.empty()) return;
        std::remove_reference_t<decltype(values)> split;
        split.reserve(table.keys().size());
        for (const Key& k : table.keys()) split.push_back(values[k.vertex]);
        values = std::move(split);
    });
    const auto take = [&](auto& list, auto member) {
        list.clear();
        for (const Key& k : table.keys()) list.push_back(k.data.*member);
    };
    if (has_uvs) take(mesh.uvs, &CornerData::uv);
    if (has_colors) take(mesh.colors, &CornerData::color);
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
            else if (e.name == "tristrips")
                strips(e);
            else
                skip(e);
        }
        // Vertices have the better claim to colours, faces to texture coordinates.
        const bool face_colors = has_face_colors_ && mesh_.colors.empty();
        if (has_face_colors_ && !face_colors)
            mesh_.notes.push_back(
                "the colours of faces are not used, since the vertices have some");
        if (has_face_uvs_ || face_colors) {
            check_indices();
            complete_corners();
            split_vertices(mesh_, corners_, has_face_uvs_, face_colors);
        }
        if (has_several_textures_)
            mesh_.notes.push_back("its faces name several textures (texnumber), but all have the "
                                  "one material of the shape");
        if (!unused_.empty())
            mesh_.notes.push_back(fmt::format("not used: {}", fmt::join(unused_, ", ")));
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
                   has_colors = has(kColorSlot, 3), has_alphas = has(kAlphaSlot, 1),
                   has_second_uvs = has(kSecondUvSlot, 2);
        // Integers are fractions of their largest value.
        float color_scale = 1, alpha_scale = 1;
        for (size_t k = 0; k < slots.size(); ++k) {
            if (slots[k] == kColorSlot) color_scale = unit_scale(e.properties[k].type);
            if (slots[k] == kAlphaSlot) alpha_scale = unit_scale(e.properties[k].type);
            if (slots[k] == kNoSlot) note_unused("vertex", e.properties[k]);
        }

        mesh_.positions.resize(e.count);
        if (has_normals) mesh_.normals.resize(e.count);
        if (has_uvs) mesh_.uvs.resize(e.count);
        if (has_colors) mesh_.colors.resize(e.count);
        if (has_alphas) mesh_.alphas.resize(e.count);
        if (has_second_uvs) mesh_.second_uvs.resize(e.count);
        for_records(e, slots, [&](uint64_t i, const VertexRecord& r) {
            const float* v = r.values;
            if (!std::isfinite(v[0]) || !std::isfinite(v[1]) || !std::isfinite(v[2]))
                in_.fail("position of vertex " + std::to_string(i) + " is not finite");
            mesh_.positions[i] = {v[0], v[1], v[2]};
            if (has_normals) mesh_.normals[i] = {v[3], v[4], v[5]};
            if (has_uvs) mesh_.uvs[i] = {v[6], v[7]};
            if (has_colors) mesh_.colors[i] = Vec3{v[8], v[9], v[10]} * color_scale;
            if (has_alphas) mesh_.alphas[i] = v[11] * alpha_scale;
            if (has_second_uvs) mesh_.second_uvs[i] = {v[12], v[13]};
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

    void note_unused(const char* element, const Property& p) {
        constexpr size_t kMost = 8, kLongest = 40;
        if (is_measurement(p.name) || unused_.size() > kMost) return;
        unused_.push_back(unused_.size() == kMost
                              ? "..."
                              : fmt::format("{} of {}", p.name.substr(0, kLongest), element));
    }

    const Property& index_list(const Element& e) {
        const auto is_indices = [](const Property& p) {
            return p.count_type && (p.name == "vertex_indices" || p.name == "vertex_index");
        };
        const auto indices = std::find_if(e.properties.begin(), e.properties.end(), is_indices);
        if (indices == e.properties.end())
            in_.fail(fmt::format("the {} have no list vertex_indices",
                                 e.name == "face" ? "faces" : e.name));
        if (!is_integer(indices->type)) in_.fail("vertex_indices must be integers");
        return *indices;
    }

    /// The properties of faces that are used, other than their indices.
    struct FaceProperties {
        const Property *uvs = nullptr, *texture = nullptr;
        std::array<const Property*, 3> color{};
        float color_scale = 1;

        bool has_color() const { return color[0] && color[1] && color[2]; }
        /// 0 to 2 of a colour's channel, else -1.
        int channel(const Property& p) const {
            for (int c = 0; c < 3; ++c)
                if (&p == color[size_t(c)]) return c;
            return -1;
        }
    };
    FaceProperties find_properties(const Element& e, const Property& indices) {
        FaceProperties f;
        for (const Property& p : e.properties) {
            const int slot = p.count_type ? kNoSlot : vertex_slot(p.name);
            if (&p == &indices) continue;
            if (p.count_type && (p.name == "texcoord" || p.name == "texcoords"))
                f.uvs = &p;
            else if (!p.count_type && p.name == "texnumber")
                f.texture = &p;
            else if (slot >= kColorSlot && slot < kColorSlot + 3)
                f.color[size_t(slot - kColorSlot)] = &p;
            else
                note_unused("face", p);
        }
        if (f.has_color()) f.color_scale = unit_scale(f.color[0]->type);
        return f;
    }

    void faces(const Element& e) {
        const Property& indices = index_list(e);
        const FaceProperties extra = find_properties(e, indices);
        has_face_uvs_ |= extra.uvs != nullptr;
        has_face_colors_ |= extra.has_color();
        complete_corners();
        mesh_.triangles.reserve(mesh_.triangles.size() + e.count);
        std::optional<double> texture;
        for (uint64_t i = triangles(e); i < e.count; ++i) {
            Vec3 color;
            uvs_.clear();
            polygon_.clear();
            for (const Property& p : e.properties) {
                if (&p == &indices) {
                    read_polygon(p);
                } else if (&p == extra.uvs) {
                    const uint64_t count = list_count(p);
                    for (uint64_t k = 0; k < count; ++k) uvs_.push_back(float(in_.value(p.type)));
                } else if (&p == extra.texture) {
                    const double number = in_.value(p.type);
                    has_several_textures_ |= texture && *texture != number;
                    texture = number;
                } else if (const int c = extra.channel(p); c >= 0) {
                    color[c] = float(in_.value(p.type)) * extra.color_scale;
                } else {
                    skip(p);
                }
            }
            add_polygon(color);
        }
    }
    void add_polygon(Vec3 color) {
        if (polygon_.size() < 3) {
            ++mesh_.dropped_degenerate;
            return;
        }
        // Faces without texture have an empty list.
        if (!uvs_.empty() && uvs_.size() != 2 * polygon_.size())
            in_.fail(fmt::format("a face of {} corners has {} texture coordinates, but needs {}",
                                 polygon_.size(), uvs_.size(), 2 * polygon_.size()));
        const auto add_corner = [&](size_t k) {
            if (!has_face_uvs_ && !has_face_colors_) return;
            const Vec2 uv = uvs_.empty() ? Vec2() : Vec2{uvs_[2 * k], uvs_[2 * k + 1]};
            if (!std::isfinite(uv.x) || !std::isfinite(uv.y))
                in_.fail("a texture coordinate of a face is not finite");
            corners_.push_back({uv, color});
        };
        for (size_t k = 2; k < polygon_.size(); ++k) {
            mesh_.triangles.push_back({polygon_[0], polygon_[k - 1], polygon_[k]});
            for (const size_t corner : {size_t(0), k - 1, k}) add_corner(corner);
        }
    }
    /// Corners of triangles that came without data.
    void complete_corners() {
        if (has_face_uvs_ || has_face_colors_) corners_.resize(3 * mesh_.triangles.size());
    }
    /// Strips of triangles; -1 begins a new one.
    void strips(const Element& e) {
        const Property& indices = index_list(e);
        for (uint64_t i = 0; i < e.count; ++i)
            for (const Property& p : e.properties) {
                if (&p != &indices) {
                    skip(p);
                    continue;
                }
                polygon_.clear();
                const uint64_t count = list_count(p);
                for (uint64_t k = 0; k < count; ++k) {
                    const int64_t v = in_.integer(p.type);
                    if (v == -1) {
                        add_strip();
                        polygon_.clear();
                    } else {
                        polygon_.push_back(vertex_index(v));
                    }
                }
                add_strip();
            }
    }
    void add_strip() {
        for (size_t k = 2; k < polygon_.size(); ++k) {
            const size_t odd = k % 2;
            mesh_.triangles.push_back({polygon_[k - 2 + odd], polygon_[k - 1 - odd], polygon_[k]});
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
    void read_polygon(const Property& p) {
        const uint64_t count = list_count(p);
        if (count < 3) return in_.skip(p.type, count);
        for (uint64_t i = 0; i < count; ++i) polygon_.push_back(vertex_index(in_.integer(p.type)));
    }
    /// Checks the index where the vertices were read before the faces, as usual, so that the error names the line.
    /// Otherwise finish_mesh() checks it.
    uint32_t vertex_index(int64_t v) const {
        const size_t limit =
            mesh_.positions.empty() ? std::numeric_limits<uint32_t>::max() : mesh_.positions.size();
        if (v < 0 || uint64_t(v) >= limit)
            in_.fail("vertex index " + std::to_string(v) + " must lie in [0, " +
                     std::to_string(limit - 1) + "]");
        return uint32_t(v);
    }
    /// Of all triangles, once the vertices are known.
    void check_indices() const {
        for (const MeshData::Triangle& t : mesh_.triangles)
            for (const uint32_t v : t)
                if (v >= mesh_.positions.size())
                    in_.fail(fmt::format("a face refers to vertex {}, but there are only {}", v,
                                         mesh_.positions.size()));
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
    std::vector<uint32_t> polygon_;  ///< Of the face that is being read,
    std::vector<float> uvs_;         ///< and its texture coordinates.
    bool has_face_uvs_ = false, has_face_colors_ = false, has_several_textures_ = false;
    std::vector<CornerData>
        corners_;  ///< Three for each triangle, if faces have data of their own.
    std::vector<std::string> unused_;
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
    return read_in_memory(path, [&] {
        std::string bytes = read_file_bytes(path);
        if (is_gzip(bytes)) bytes = unpack_gzip(bytes, path);
        return parse_ply(bytes, path, options);
    });
}

}  // namespace etendue
