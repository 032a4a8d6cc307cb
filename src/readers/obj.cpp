#include "readers/obj.h"

#include <algorithm>
#include <limits>

#include "math/hash.h"
#include "readers/file_bytes.h"
#include "readers/key_table.h"
#include "readers/text_cursor.h"

namespace etendue {
namespace {

/// Index for an attribute that is missing from a corner.
constexpr uint32_t kNone = std::numeric_limits<uint32_t>::max();

/// Indices (from 0) of one face corner.
struct Corner {
    uint32_t position, uv, normal;
    bool operator==(const Corner&) const = default;
};

struct CornerHash {
    uint64_t operator()(const Corner& c) const {
        return hash_combine(uint64_t(c.position) << 32 | c.uv, c.normal);
    }
};

class ObjParser {
public:
    ObjParser(std::string_view text, const std::string& file) : in_(text, file) {}

    MeshData parse() {
        while (!in_.at_end()) {
            if (in_.skip_blanks()) statement();
            in_.next_line();
        }
        return assemble();
    }

private:
    /// Largest index of one attribute used by faces; checked after the whole file is read.
    struct Largest {
        uint32_t index = 0;
        int line = 0;  ///< 0 where faces use none.
    };

    void statement() {
        const std::string_view keyword = in_.word();
        if (keyword == "v") {
            positions_.push_back(vector("coordinate"));
        } else if (keyword == "vt") {
            uvs_.push_back(uv());
        } else if (keyword == "vn") {
            normals_.push_back(normal());
        } else if (keyword == "f") {
            face();
        }
    }

    /// Whether the current line has another word before a comment.
    bool more() { return in_.skip_blanks() && !in_.at_char('#'); }
    float number(const char* what) {
        in_.skip_blanks();
        return in_.number(what);
    }
    Vec3 vector(const char* what) {
        const float x = number(what), y = number(what), z = number(what);
        return {x, y, z};
    }
    Vec2 uv() {
        const float u = number("texture coordinate");
        return {u, more() ? number("texture coordinate") : 0};
    }
    /// NaN is accepted, since exporters write it for faces of zero area; finish_mesh() replaces it.
    Vec3 normal() {
        Vec3 n;
        for (int i = 0; i < 3; ++i) {
            in_.skip_blanks();
            n[i] = in_.number_or_nan("normal");
        }
        return n;
    }

    void face() {
        polygon_.clear();
        while (more()) polygon_.push_back(table_.index_of(corner()));
        if (polygon_.size() < 3)
            in_.fail("a face needs at least three corners, found " +
                     std::to_string(polygon_.size()));
        for (size_t i = 2; i < polygon_.size(); ++i)
            triangles_.push_back({polygon_[0], polygon_[i - 1], polygon_[i]});
    }
    /// v, v/vt, v//vn or v/vt/vn.
    Corner corner() {
        Corner c{index(positions_.size(), largest_position_), kNone, kNone};
        if (!in_.skip_char('/')) return c;
        if (in_.skip_char('/')) {
            c.normal = index(normals_.size(), largest_normal_);
            return c;
        }
        c.uv = index(uvs_.size(), largest_uv_);
        if (in_.skip_char('/')) c.normal = index(normals_.size(), largest_normal_);
        return c;
    }
    /// Positive indices count from 1, negative ones back from the last of the `count` elements read so far.
    uint32_t index(size_t count, Largest& largest) {
        const int64_t given = in_.integer("index");
        const int64_t i = given > 0 ? given - 1 : int64_t(count) + given;
        if (given == 0 || i < 0 || i >= kNone)
            in_.fail("index " + std::to_string(given) + " is out of range");
        if (largest.line == 0 || i > largest.index) largest = {uint32_t(i), in_.line()};
        return uint32_t(i);
    }

    void check(const Largest& largest, size_t count, const char* what) const {
        if (largest.line != 0 && largest.index >= count)
            throw SceneError({in_.where().file, largest.line},
                             "a face refers to " + std::string(what) + " " +
                                 std::to_string(uint64_t(largest.index) + 1) +
                                 ", but there are only " + std::to_string(count));
    }

    MeshData assemble() {
        check(largest_position_, positions_.size(), "vertex");
        check(largest_uv_, uvs_.size(), "texture coordinate");
        check(largest_normal_, normals_.size(), "normal");
        MeshData mesh;
        mesh.triangles = std::move(triangles_);
        const auto& corners = table_.keys();
        for (const Corner& c : corners) mesh.positions.push_back(positions_[c.position]);
        // Where only some corners have an attribute, the others get texture coordinates (0, 0), and normals from
        // finish_mesh().
        if (largest_uv_.line != 0)
            for (const Corner& c : corners) mesh.uvs.push_back(c.uv == kNone ? Vec2{} : uvs_[c.uv]);
        if (largest_normal_.line != 0)
            for (const Corner& c : corners)
                mesh.normals.push_back(c.normal == kNone ? Vec3{} : normals_[c.normal]);
        return mesh;
    }

    TextCursor in_;
    std::vector<Vec3> positions_, normals_;
    std::vector<Vec2> uvs_;
    std::vector<MeshData::Triangle> triangles_;
    KeyTable<Corner, CornerHash> table_;
    std::vector<uint32_t> polygon_;
    Largest largest_position_, largest_uv_, largest_normal_;
};

}  // namespace

MeshData parse_obj(std::string_view text, const std::string& name, const MeshOptions& options) {
    MeshData mesh = ObjParser(plain_text(text, name), name).parse();
    mesh.name = name;
    finish_mesh(mesh, options, {name, 0});
    return mesh;
}

MeshData read_obj(const std::string& path, const MeshOptions& options) {
    return read_in_memory(path, [&] { return parse_obj(read_file_bytes(path), path, options); });
}

}  // namespace etendue
