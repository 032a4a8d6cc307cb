#pragma once
// Implementation of mitsuba_xml.h: one object reads one scene.

#include <array>
#include <functional>
#include <map>
#include <optional>
#include <set>
#include <string>
#include <string_view>
#include <vector>

#include <pugixml.hpp>

#include "readers/mitsuba_element.h"
#include "readers/mitsuba_parameters.h"
#include "readers/mitsuba_spectrum.h"
#include "readers/read_options.h"

namespace etendue {

class MitsubaReader {
public:
    /// `options` must outlive the reader.
    MitsubaReader(const std::string& file, const ReadOptions& options);
    /// Reads the scene of which `text` is the main file; to be called once.
    SceneDescription read(std::string_view text);

private:
    /// One XML file being read.
    struct Source {
        Source(const std::string& name, std::string_view contents, std::array<int, 3> version);
        bool is_old() const { return version[0] < 2; }  ///< The dialect of Mitsuba 0.
        int line(ptrdiff_t offset) const;

        FileName file;
        std::string directory;
        std::string_view text;
        std::vector<size_t> line_ends;
        std::array<int, 3> version;  ///< Of Mitsuba.
    };
    /// The object, or the scene itself, whose children are being read.
    struct Scope {
        int object = -1;  ///< Index of the object; -1 for the scene.
        std::string category = "scene";
        int depth = 0;
        bool in_emitter = false;
        std::set<std::string> names;  ///< Names of the parameters and children read so far.
    };
    struct Rule {
        const char* element;
        const char* required;  ///< Attributes, separated by blanks.
        const char* optional;
        void (MitsubaReader::*read)(const Element&, const pugi::xml_node&, Scope&);
    };
    struct Reference {
        int parent;   ///< -1 for the scene.
        size_t slot;  ///< Index among the parent's children.
        std::string id;
        SourceLocation where;
    };
    static const std::vector<Rule> kRules;
    static const std::vector<Rule> kTransformSteps;

    // Documents, objects and the references between them: mitsuba_reader.cpp.
    void read_document(std::string_view text, const std::string& file, Scope& scope,
                       const Element* include);
    pugi::xml_node find_root(const pugi::xml_document& document) const;
    void read_version(const pugi::xml_node& root);
    void read_children(const pugi::xml_node& parent, Scope& scope);
    void read_element(const pugi::xml_node& node, Scope& scope);
    void read_object(const Element& e, const pugi::xml_node& node, Scope& scope);
    void read_include(const Element& e, const pugi::xml_node&, Scope& scope);
    void read_ref(const Element& e, const pugi::xml_node&, Scope& scope);
    void read_alias(const Element& e, const pugi::xml_node&, Scope&);
    void read_default(const Element& e, const pugi::xml_node&, Scope&);
    void read_path(const Element& e, const pugi::xml_node&, Scope& scope);
    Element open(const pugi::xml_node& node, std::string_view required, std::string_view optional);
    std::string claim_name(const Element& e, Scope& scope);
    void add_child(const Scope& scope, const std::string& name, int object,
                   const SourceLocation& where);
    void declare_id(const std::string& id, int object, const SourceLocation& where);
    int find_id(const std::string& id, const SourceLocation& where) const;
    void resolve_references();
    void add_null_materials();
    std::string load(const std::string& name, const SourceLocation& where, std::string& path);

    // Elements that are a parameter of the object they stand in: mitsuba_reader_params.cpp.
    void read_boolean(const Element& e, const pugi::xml_node&, Scope& scope);
    void read_integer(const Element& e, const pugi::xml_node&, Scope& scope);
    void read_float(const Element& e, const pugi::xml_node&, Scope& scope);
    void read_string(const Element& e, const pugi::xml_node&, Scope& scope);
    void read_vector(const Element& e, const pugi::xml_node&, Scope& scope);
    void read_rgb(const Element& e, const pugi::xml_node&, Scope& scope);
    void read_srgb(const Element& e, const pugi::xml_node&, Scope& scope);
    void read_blackbody(const Element& e, const pugi::xml_node&, Scope& scope);
    void read_spectrum(const Element& e, const pugi::xml_node& node, Scope& scope);
    void read_transform(const Element& e, const pugi::xml_node& node, Scope& scope);
    void add_param(const Element& e, Scope& scope, ParamValue value);
    using SpectrumOfRole = std::function<Rgb(SpectrumRole)>;
    SpectrumOfRole spectrum_from_file(const Element& e, const pugi::xml_node& node);
    SpectrumOfRole spectrum_from_value(const Element& e, const pugi::xml_node& node) const;
    SpectrumOfRole spectrum_from_plugin(const Element& e, const pugi::xml_node& node,
                                        const Scope& scope);
    /// Gives the spectra of textures the role of what the textures are used for, which may stand behind them.
    void set_spectra_of_textures();

    SourceLocation locate(const pugi::xml_node& node) const;
    [[noreturn]] void fail_text(const pugi::xml_node& text) const;
    void check_leaf(const pugi::xml_node& node) const;
    /// Throws SceneError, or under `lenient` adds a warning that something was dropped.
    void reject(const SourceLocation& where, const std::string& what, const std::string& hint);

    const ReadOptions& options_;
    SceneParameters parameters_;
    SceneDescription scene_;
    std::map<std::string, int> ids_;
    std::vector<Reference> references_;
    struct TextureSpectrum {
        int texture;
        std::string name;
        SpectrumOfRole colour;
    };
    std::vector<TextureSpectrum> texture_spectra_;
    std::vector<int> old_shapes_;  ///< Of the dialect of Mitsuba 0.6.
    Source* source_ = nullptr;
    std::vector<std::string> open_files_;  ///< The chain of includes.
    int includes_ = 0, elements_ = 0;
};

}  // namespace etendue
