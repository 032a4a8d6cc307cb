#include <algorithm>
#include <cmath>
#include <cstdint>
#include <iterator>

#include <fmt/format.h>

#include "description/scene_description.h"

namespace etendue {
namespace {

std::string escape(std::string_view text) {
    std::string out = "\"";
    for (char c : text) {
        if (c == '"' || c == '\\')
            (out += '\\') += c;
        else if (static_cast<unsigned char>(c) < 0x20)
            out += fmt::format("\\x{:02x}", int(c));
        else
            out += c;
    }
    return out + '"';
}

/// Sixteen numbers with six digits. Rounding errors (entries below 1e-9 of the largest) are printed as zero, so that a
/// rotation by 90° has exact zeros.
std::string print(const Transform& t) {
    double largest = 0;
    for (const auto& row : t.matrix())
        for (double v : row) largest = std::max(largest, std::fabs(v));
    std::string out = "transform";
    for (const auto& row : t.matrix())
        for (double v : row) out += fmt::format(" {:.6g}", std::fabs(v) < 1e-9 * largest ? 0.0 : v);
    return out;
}

struct Printer {
    std::string operator()(bool v) const { return fmt::format("boolean {}", v); }
    std::string operator()(int64_t v) const { return fmt::format("integer {}", v); }
    std::string operator()(double v) const { return fmt::format("float {}", v); }
    std::string operator()(const std::string& v) const { return "string " + escape(v); }
    std::string operator()(Vec3 v) const { return fmt::format("vector {} {} {}", v.x, v.y, v.z); }
    std::string operator()(Rgb v) const { return fmt::format("rgb {} {} {}", v.r, v.g, v.b); }
    std::string operator()(const Transform& v) const { return print(v); }
};

class Dumper {
public:
    explicit Dumper(const SceneDescription& scene)
        : scene_(scene), uses_(scene.objects.size()), labels_(scene.objects.size()) {
        for (int root : scene.roots) ++uses_[root];
        for (const SceneObject& object : scene.objects)
            for (const auto& child : object.children) ++uses_[child.object];
    }

    std::string run() {
        for (int root : scene_.roots) print_object(root, "", 0);
        return std::move(out_);
    }

private:
    /// An object with several parents is printed once, with a label; afterwards only its label is printed.
    void print_object(int index, const std::string& name, int depth) {
        const SceneObject& object = scene_.objects[index];
        out_.append(size_t(depth) * 2, ' ');
        if (!name.empty()) out_ += name + ": ";
        if (labels_[index] > 0) {
            out_ += fmt::format("{} #{}\n", object.category, labels_[index]);
            return;
        }
        out_ += object.category + ' ' + object.type;
        if (!object.id.empty()) out_ += " id " + escape(object.id);
        if (uses_[index] > 1) out_ += fmt::format(" #{}", labels_[index] = ++last_label_);
        out_ += '\n';

        std::vector<const Param*> params;
        for (const Param& p : object.params) params.push_back(&p);
        std::stable_sort(params.begin(), params.end(),
                         [](auto a, auto b) { return a->name < b->name; });
        for (const Param* p : params) {
            out_.append(size_t(depth + 1) * 2, ' ');
            out_ += p->name + ": " + to_string(p->value) + '\n';
        }
        // Unnamed children sort first and keep their order.
        std::vector<const SceneObject::Child*> children;
        for (const auto& c : object.children) children.push_back(&c);
        std::stable_sort(children.begin(), children.end(),
                         [](auto a, auto b) { return a->name < b->name; });
        for (const auto* c : children) print_object(c->object, c->name, depth + 1);
    }

    const SceneDescription& scene_;
    std::vector<int> uses_, labels_;
    int last_label_ = 0;
    std::string out_;
};

}  // namespace

std::string to_string(const ParamValue& value) {
    return std::visit(Printer{}, value);
}

std::string dump(const SceneDescription& scene) {
    return Dumper(scene).run();
}

}  // namespace etendue
