#include "readers/mitsuba_reader.h"

#include <algorithm>
#include <array>
#include <cctype>
#include <filesystem>

#include <fmt/format.h>

#include "description/resolve_file.h"
#include "readers/file_bytes.h"
#include "readers/line_ends.h"
#include "readers/mitsuba_old_versions.h"
#include "readers/mitsuba_upgrade.h"
#include "readers/mitsuba_values.h"
#include "readers/nesting.h"
#include "readers/object_graph.h"
#include "readers/xml_entities.h"
#include "readers/xml_tags.h"

namespace etendue {
namespace {

// Limits far beyond any real scene, which keep malicious files from exhausting stack, time or memory.
constexpr int kDeepestNesting = 64;
constexpr size_t kDeepestInclude = 32;
constexpr int kMostIncludes = 10'000;
constexpr int kMostElements = 20'000'000;
constexpr size_t kLongestName = 1024;

/// Of scenes without a version.
constexpr std::array kNewest{3, 0, 0};

std::vector<std::string> words(std::string_view list) {
    std::vector<std::string> found;
    for (size_t begin = 0; begin < list.size();) {
        const size_t end = std::min(list.find(' ', begin), list.size());
        found.emplace_back(list.substr(begin, end - begin));
        begin = end + 1;
    }
    return found;
}

std::string join(const std::string& directory, const std::string& name) {
    if (directory == ".") return name;
    return (std::filesystem::path(directory) / name).string();
}

}  // namespace

MitsubaReader::Source::Source(const std::string& name, std::string_view contents,
                              std::array<int, 3> version_)
    : file(name), directory(directory_of(name)), text(contents), version(version_) {
    const char* const end = text.data() + text.size();
    for (size_t i = 0; i < text.size(); ++i)
        if (ends_line(text.data() + i, end)) line_ends.push_back(i);
}

int MitsubaReader::Source::line(ptrdiff_t offset) const {
    if (offset < 0) return 0;
    return 1 + int(std::lower_bound(line_ends.begin(), line_ends.end(), size_t(offset)) -
                   line_ends.begin());
}

MitsubaReader::MitsubaReader(const std::string& file, const ReadOptions& options)
    : options_(options), parameters_(options.defines) {
    scene_.file = file;
}

SceneDescription MitsubaReader::read(std::string_view text) {
    Scope root;
    read_document(text, scene_.file, root, nullptr);
    resolve_references();
    check_object_graph(scene_, kDeepestNesting);
    set_spectra_of_textures();
    parameters_.check_overrides(scene_.file);
    return std::move(scene_);
}

void MitsubaReader::reject(const SourceLocation& where, const std::string& what,
                           const std::string& more) {
    if (!options_.lenient) throw SceneError(where, what + more);
    ++scene_.left_out;
    scene_.warnings.push_back(
        fmt::format("{}:{}: {}; dropped", where.file.str(), where.line, what));
}

SourceLocation MitsubaReader::locate(const pugi::xml_node& node) const {
    // Elements that upgrade_old_version() adds are not in the text.
    pugi::xml_node written = node;
    while (written && written.offset_debug() < 0) written = written.parent();
    return {source_->file, source_->line(written.offset_debug())};
}

void MitsubaReader::fail_text(const pugi::xml_node& text) const {
    const size_t visible = source_->text.find_first_not_of(
        " \t\r\n", size_t(std::max<ptrdiff_t>(0, text.offset_debug())));
    std::string_view value = text.value();
    value.remove_prefix(std::min(value.find_first_not_of(" \t\r\n"), value.size()));
    throw SceneError({source_->file, source_->line(ptrdiff_t(visible))},
                     fmt::format("unexpected text {}: values belong in attributes", quote(value)));
}

void MitsubaReader::check_leaf(const pugi::xml_node& node) const {
    const pugi::xml_node child = node.first_child();
    if (!child) return;
    if (child.type() != pugi::node_element) fail_text(child);
    throw SceneError(locate(child),
                     fmt::format("a <{}> cannot contain a <{}>", node.name(), child.name()));
}

// ---- Documents

void MitsubaReader::read_document(std::string_view text, const std::string& file, Scope& scope,
                                  const Element* include) {
    const std::optional<std::string> expanded =
        expand_entities(text, file, [&](size_t offset) { return line_of(text, offset); });
    if (expanded) text = *expanded;
    Source source(file, text, source_ ? source_->version : kNewest);
    plain_text(text, file);  // refuses UTF-16; the parser knows the mark of UTF-8
    if (const size_t zero = text.find('\0'); zero != text.npos)
        throw SceneError({file, source.line(ptrdiff_t(zero))},
                         "a zero byte: this is not an XML file");
    pugi::xml_document document;
    // parse_fragment keeps text outside the root, which is an error; with encoding_utf8 offsets are those of `text`.
    const auto parsed = document.load_buffer(
        text.data(), text.size(), pugi::parse_default | pugi::parse_fragment, pugi::encoding_utf8);
    if (!parsed) {
        const std::string what =
            parsed.status == pugi::status_end_element_mismatch
                ? describe_wrong_end(text, size_t(parsed.offset),
                                     [&](size_t offset) { return source.line(ptrdiff_t(offset)); })
                : parsed.description();
        throw SceneError({file, source.line(parsed.offset)},
                         fmt::format("malformed XML: {}", what));
    }

    Source* const includer = source_;
    source_ = &source;
    open_files_.push_back(std::filesystem::path(file).lexically_normal().string());
    if (!include) scene_.search_paths.push_back(source.directory);

    const pugi::xml_node root = find_root(document);
    read_version(root);
    upgrade_old_version(root, source.version);
    if (std::string_view(root.name()) == "scene") {
        open(root, include ? "" : "version", include ? "version" : "");
        read_children(root, scope);
    } else if (include && is_category(root.name())) {
        Element e = open(root, "type", "id version");
        if (const std::string* name = include->find("name"))
            e.attributes.emplace_back("name", *name);
        read_object(e, root, scope);
    } else {
        throw SceneError(locate(root),
                         fmt::format("the root element must be <scene>, not <{}>", root.name()));
    }
    open_files_.pop_back();
    source_ = includer;
}

pugi::xml_node MitsubaReader::find_root(const pugi::xml_document& document) const {
    pugi::xml_node root;
    for (const pugi::xml_node& node : document.children()) {
        if (node.type() == pugi::node_pcdata || node.type() == pugi::node_cdata) fail_text(node);
        if (node.type() != pugi::node_element) continue;
        if (root)
            throw SceneError(locate(node), fmt::format("a second root element, <{}>", node.name()));
        root = node;
    }
    if (!root) throw SceneError({source_->file, 1}, "the file is empty: expected a <scene>");
    return root;
}

void MitsubaReader::read_version(const pugi::xml_node& root) {
    const pugi::xml_attribute attribute = root.attribute("version");
    if (!attribute) return;
    const std::string text = attribute.value();
    std::array<int, 3> version{};
    size_t part = 0;
    bool valid = !text.empty() && text.size() < 16;
    for (char c : text) {
        if (c == '.')
            valid = valid && ++part < version.size();
        else if (c >= '0' && c <= '9' && valid)
            version[part] = version[part] * 10 + (c - '0');
        else
            valid = false;
        if (!valid || version[part] > 9999) break;
    }
    if (!valid || part != 2)
        throw SceneError(locate(root), fmt::format("expected a version such as \"3.0.0\", found {}",
                                                   quote(text)));
    if (version[0] > 3)
        throw SceneError(locate(root),
                         fmt::format("unknown version {} (known: up to 3.x)", quote(text)));
    source_->version = version;
}

// ---- Elements

void MitsubaReader::read_children(const pugi::xml_node& parent, Scope& scope) {
    if (scope.depth > kDeepestNesting)
        throw SceneError(locate(parent), fmt::format("elements are nested more than {} levels deep",
                                                     kDeepestNesting));
    for (const pugi::xml_node& node : parent.children()) {
        if (node.type() != pugi::node_element) fail_text(node);
        read_element(node, scope);
    }
}

void MitsubaReader::read_element(const pugi::xml_node& node, Scope& scope) {
    const std::string_view name = node.name();
    if (is_category(name)) {
        read_object(open(node, "type", "name id"), node, scope);
        return;
    }
    auto same_name = [&](const Rule& rule) { return rule.element == name; };
    const auto rule = std::find_if(kRules.begin(), kRules.end(), same_name);
    if (rule != kRules.end()) {
        (this->*rule->read)(open(node, rule->required, rule->optional), node, scope);
        return;
    }
    if (std::any_of(kTransformSteps.begin(), kTransformSteps.end(), same_name))
        throw SceneError(locate(node), fmt::format("a <{}> can only stand in a <transform>", name));
    std::vector<std::string> known;
    for (const std::string& c : object_categories()) known.push_back(c);
    for (const Rule& r : kRules) known.push_back(r.element);
    reject(locate(node), fmt::format("unknown element <{}>", name.substr(0, kLongestName)),
           hint(name, known));
}

Element MitsubaReader::open(const pugi::xml_node& node, std::string_view required,
                            std::string_view optional) {
    Element e{node.name(), locate(node), {}};
    if (++elements_ > kMostElements)
        throw SceneError(e.where,
                         fmt::format("the scene has more than {} elements", kMostElements));
    for (const pugi::xml_attribute& attribute : node.attributes()) {
        const std::string name = attribute.name();
        if (!has_word(required, name) && !has_word(optional, name)) {
            std::vector<std::string> known = words(required);
            for (const std::string& word : words(optional)) known.push_back(word);
            reject(e.where, fmt::format("<{}> has no attribute {}", e.name, quote(name)),
                   hint(name, known));
            continue;
        }
        if (e.find(name))
            throw SceneError(e.where,
                             fmt::format("<{}> has the attribute {} twice", e.name, quote(name)));
        e.attributes.emplace_back(name, parameters_.substitute(attribute.value(), e.where));
    }
    for (const std::string& name : words(required))
        if (!e.find(name))
            throw SceneError(e.where, fmt::format("<{}> needs the attribute \"{}\"", e.name, name));
    for (const char* name : {"name", "id", "as", "type", "filename"})
        if (const std::string* value = e.find(name);
            value && (value->empty() || value->size() > kLongestName))
            throw SceneError(
                e.where, fmt::format("the attribute \"{}\" of <{}> must have 1 to {} characters",
                                     name, e.name, kLongestName));
    return e;
}

std::string MitsubaReader::claim_name(const Element& e, Scope& scope) {
    const std::string* given = e.find("name");
    if (!given) return {};
    const std::string name = source_->is_old() ? snake_case(*given) : *given;
    if (scope.object >= 0 && !scope.names.insert(name).second)
        throw SceneError(e.where, fmt::format("parameter {} is given twice", quote(name)));
    return name;
}

// ---- Objects and references

void MitsubaReader::read_object(const Element& e, const pugi::xml_node& node, Scope& scope) {
    check_nesting(scope.category, e.name, e.where);
    const int index = int(scene_.objects.size());
    scene_.objects.push_back({.category = e.name,
                              .type = e["type"],
                              .id = {},
                              .where = e.where,
                              .params = {},
                              .children = {}});
    if (const std::string* id = e.find("id")) {
        declare_id(*id, index, e.where);
        scene_.objects[index].id = *id;
    }
    add_child(scope, claim_name(e, scope), index, e.where);
    Scope inner{index, e.name, scope.depth + 1, scope.in_emitter || e.name == "emitter", {}};
    read_children(node, inner);
    if (!source_->is_old()) return;
    upgrade_object(scene_.objects[index]);
    if (e.name == "shape") old_shapes_.push_back(index);
}

void MitsubaReader::add_child(const Scope& scope, const std::string& name, int object,
                              const SourceLocation& where) {
    if (scope.object < 0)
        scene_.roots.push_back(object);
    else
        scene_.objects[scope.object].children.push_back({name, object, where});
}

void MitsubaReader::declare_id(const std::string& id, int object, const SourceLocation& where) {
    const auto [it, inserted] = ids_.emplace(id, object);
    if (inserted) return;
    const SourceLocation& first = scene_.objects[it->second].where;
    throw SceneError(where, fmt::format("the id {} is taken by the <{}> at {}:{}", quote(id),
                                        scene_.objects[it->second].category, first.file.str(),
                                        first.line));
}

int MitsubaReader::find_id(const std::string& id, const SourceLocation& where) const {
    if (const auto it = ids_.find(id); it != ids_.end()) return it->second;
    std::vector<std::string> known;
    for (const auto& [name, object] : ids_) known.push_back(name);
    throw SceneError(where, fmt::format("no object has the id {}{}", quote(id), hint(id, known)));
}

void MitsubaReader::read_ref(const Element& e, const pugi::xml_node& node, Scope& scope) {
    check_leaf(node);
    if (scope.category == "spectrum")
        throw SceneError(e.where, "a <ref> cannot stand in a <spectrum>");
    const size_t slot =
        scope.object < 0 ? scene_.roots.size() : scene_.objects[scope.object].children.size();
    add_child(scope, claim_name(e, scope), -1, e.where);
    references_.push_back({scope.object, slot, e["id"], e.where});
}

void MitsubaReader::read_alias(const Element& e, const pugi::xml_node& node, Scope&) {
    check_leaf(node);
    declare_id(e["as"], find_id(e["id"], e.where), e.where);
}

void MitsubaReader::resolve_references() {
    for (const Reference& r : references_) {
        const int target = find_id(r.id, r.where);
        if (r.parent < 0) {
            scene_.roots[r.slot] = target;
            continue;
        }
        SceneObject& parent = scene_.objects[r.parent];
        check_nesting(parent.category, scene_.objects[target].category, r.where);
        parent.children[r.slot].object = target;
    }
    add_null_materials();
}

/// In Mitsuba 0.6 a shape with a medium and without a material is invisible.
void MitsubaReader::add_null_materials() {
    for (int shape : old_shapes_) {
        bool has_medium = false, has_bsdf = false;
        for (const auto& c : scene_.objects[shape].children) {
            const std::string& category = scene_.objects[c.object].category;
            has_medium = has_medium || category == "medium";
            has_bsdf = has_bsdf || category == "bsdf" || category == "subsurface";
        }
        if (!has_medium || has_bsdf) continue;
        const SourceLocation where = scene_.objects[shape].where;
        scene_.objects[shape].children.push_back({"", int(scene_.objects.size()), where});
        scene_.objects.push_back({.category = "bsdf",
                                  .type = "null",
                                  .id = {},
                                  .where = where,
                                  .params = {},
                                  .children = {}});
    }
}

// ---- Parameters of the scene and files

void MitsubaReader::read_default(const Element& e, const pugi::xml_node& node, Scope&) {
    check_leaf(node);
    const std::string& name = e["name"];
    if (!std::all_of(name.begin(), name.end(),
                     [](unsigned char c) { return std::isalnum(c) || c == '_'; }))
        throw SceneError(
            e.where,
            fmt::format("a parameter's name must have only letters, digits and '_', but is {}",
                        quote(name)));
    parameters_.declare(name, e["value"]);
}

void MitsubaReader::read_path(const Element& e, const pugi::xml_node& node, Scope& scope) {
    check_leaf(node);
    if (scope.object >= 0) throw SceneError(e.where, "a <path> can only stand in the <scene>");
    scene_.search_paths.push_back(join(source_->directory, e["value"]));
}

void MitsubaReader::read_include(const Element& e, const pugi::xml_node& node, Scope& scope) {
    check_leaf(node);
    if (++includes_ > kMostIncludes)
        throw SceneError(e.where,
                         fmt::format("the scene includes more than {} files", kMostIncludes));
    if (open_files_.size() > kDeepestInclude)
        throw SceneError(e.where, fmt::format("files include each other more than {} levels deep",
                                              kDeepestInclude));
    std::string path;
    const std::string text = load(e["filename"], e.where, path);
    const std::string normal = std::filesystem::path(path).lexically_normal().string();
    if (std::find(open_files_.begin(), open_files_.end(), normal) != open_files_.end())
        throw SceneError(e.where, fmt::format("{} includes itself", quote(path)));
    read_document(text, path, scope, &e);
}

std::string MitsubaReader::load(const std::string& name, const SourceLocation& where,
                                std::string& path) {
    std::vector<std::string> directories = {source_->directory};
    for (const std::string& directory : scene_.search_paths)
        if (directory != source_->directory) directories.push_back(directory);
    for (const std::string& spelling : spellings(name))
        for (const std::string& directory : directories) {
            path = join(directory, spelling);
            if (auto contents = read_named_file(options_, path, where)) return *std::move(contents);
        }
    throw SceneError(where, fmt::format("cannot read the file {} (looked in {}{})", quote(name),
                                        fmt::join(directories, ", "),
                                        options_.is_disk ? near_file_hint(name, directories) : ""));
}

}  // namespace etendue
