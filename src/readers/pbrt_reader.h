#pragma once
// The machine behind pbrt.h: one object reads one scene, directive by directive.

#include <deque>
#include <functional>
#include <map>
#include <optional>
#include <string>
#include <string_view>
#include <vector>

#include "readers/pbrt_scene.h"

namespace etendue {

class PbrtReader {
public:
    /// `options` must outlive the reader.
    PbrtReader(const std::string& file, const ReadOptions& options) : scene_(file, options) {}
    /// Reads the scene of which `text` is the main file; to be called once.
    SceneDescription read(std::string_view text);

private:
    enum class Place { Options, World, Anywhere };  ///< Before or after WorldBegin.
    struct Directive {
        std::string_view name;
        int versions;
        Place place;
        void (PbrtReader::*read)(PbrtTokenizer& in);
    };
    static const std::vector<Directive> kDirectives;

    struct OpenFile {
        std::string path, text;  ///< The main file and imported ones store their text elsewhere.
    };
    void read_file(std::string_view text, const std::string& path);
    /// Forgets the included files that the tokenizer has left.
    void close_files(const PbrtTokenizer& in);
    OpenFile load_included(PbrtTokenizer& in);
    void read_directive(PbrtTokenizer& in, std::string_view word);

    void identity(PbrtTokenizer&);
    void translate(PbrtTokenizer& in);
    void scale(PbrtTokenizer& in);
    void rotate(PbrtTokenizer& in);
    void look_at(PbrtTokenizer& in);
    void transform(PbrtTokenizer& in);
    void concat_transform(PbrtTokenizer& in);
    void coordinate_system(PbrtTokenizer& in);
    void coord_sys_transform(PbrtTokenizer& in);
    void active_transform(PbrtTokenizer& in);
    void transform_times(PbrtTokenizer& in);
    void transform_begin(PbrtTokenizer& in);
    void transform_end(PbrtTokenizer& in);
    void attribute_begin(PbrtTokenizer& in);
    void attribute_end(PbrtTokenizer& in);
    void attribute(PbrtTokenizer& in);
    void reverse_orientation(PbrtTokenizer&);
    void medium_interface(PbrtTokenizer& in);
    void make_named_medium(PbrtTokenizer& in);
    void texture(PbrtTokenizer& in);
    void material(PbrtTokenizer& in);
    void make_named_material(PbrtTokenizer& in);
    void named_material(PbrtTokenizer& in);
    void light_source(PbrtTokenizer& in);
    void area_light_source(PbrtTokenizer& in);
    void shape(PbrtTokenizer& in);
    void object_begin(PbrtTokenizer& in);
    void object_end(PbrtTokenizer& in);
    void object_instance(PbrtTokenizer& in);
    void include(PbrtTokenizer& in);
    void import(PbrtTokenizer& in);
    void camera(PbrtTokenizer& in);
    void film(PbrtTokenizer& in);
    void pixel_filter(PbrtTokenizer& in);
    void sampler(PbrtTokenizer& in);
    void integrator(PbrtTokenizer& in);
    void accelerator(PbrtTokenizer& in);
    void option(PbrtTokenizer& in);
    void color_space(PbrtTokenizer& in);
    void world_begin(PbrtTokenizer& in);
    void world_end(PbrtTokenizer& in);

    /// `"name" parameters` after the directive `kind`; the defaults are those of pbrt-v4's Attribute.
    PbrtArguments arguments(PbrtTokenizer& in, const char* kind, const char* defaults = "");
    /// What a directive names: made by its table's entry. Refused or unknown ones are -1 under `lenient`.
    int make(PbrtArguments& args, const std::vector<PbrtEntry>& table, const std::string& stand_in);
    /// Type of a named material or medium, taken out of its parameters.
    PbrtArguments take_type(PbrtArguments args, const char* kind);
    int make_material(PbrtArguments& args);
    void push(const char* what, PbrtPlace where);
    void pop(const char* what, const char* closing, PbrtPlace where);
    /// Something that needs a name which pbrt-v4 may define later, with the state in which it is to be made.
    struct Waiting {
        int order;  ///< In the file.
        PbrtState state;
        int group;
        bool is_shape;
        PbrtArguments args;
        std::function<void(PbrtArguments&)> make;
    };
    /// Makes something from arguments: now, or as soon as the names are defined that it needs.
    void make_when_defined(PbrtArguments args, bool is_shape,
                           std::function<void(PbrtArguments&)> make);
    void make_waiting(Waiting what, bool may_wait);
    /// At the end of the scene: what waits in vain reports an error.
    void make_all_waiting();
    /// A texture or material that the arguments, or a shape, need, and that is not defined yet; "" if there is none. None
    /// in pbrt-v3, where names must be defined before.
    std::string missing_name(const PbrtArguments& args, bool is_shape) const;
    /// Restores what the last push() saved, and in pbrt-v3 the names that were given since then.
    void restore();
    void check_all_closed() const;
    /// Gives a name to an object: in pbrt-v3 until the end of the attributes, in pbrt-v4 for all that follows.
    void define(std::map<std::string, int>& names, const std::string& name, int object);
    void make_view();
    void finish(const SourceLocation& end);

    struct Saved {
        const char* what;  ///< "AttributeBegin", ...
        PbrtPlace where;
        PbrtState state;
        size_t hidden;  ///< Size of hidden_.
    };
    /// What a name stood for before it was given again; nothing if it was new.
    struct HiddenName {
        std::map<std::string, int>* names;
        std::string name;
        std::optional<int> object;
    };

    PbrtScene scene_;
    std::vector<Saved> stack_;
    size_t first_saved_ =
        0;  ///< The first element of the stack that belongs to the file that is being imported.
    std::vector<HiddenName> hidden_;
    std::map<std::string, std::vector<Waiting>> waiting_;  ///< By the name that they need.
    std::deque<Waiting> ready_;
    int order_ = 0;
    std::map<std::string, Transform> coordinate_systems_;
    std::vector<std::pair<std::string, PbrtPlace>> not_yet_made_;  ///< Of NamedMaterial.
    PbrtArguments camera_, film_, filter_, sampler_, integrator_;
    Transform camera_from_world_;
    bool in_world_ = false, world_ended_ = false;
    std::deque<OpenFile> open_files_;  ///< Each includes the next one.
    size_t first_open_ = 0;            ///< The main file, or the one that is being imported.
    std::deque<FileName> file_names_;  ///< Of all files; parameters refer to them.
    int includes_ = 0;
};

}  // namespace etendue
