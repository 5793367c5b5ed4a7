// SPDX-License-Identifier: GPL-3.0-or-later

// Job type for Flamenco: carry data from one character to the characters of many files, a task for each file.
// Put this file into the folder "scripts" beside flamenco-manager. The workers' Blender needs the extension.

const JOB_TYPE = {
    label: "Spectral Match",
    description: "Match the active object to the characters of other files and carry its data to them",
    settings: [
        {
            key: "blendfile",
            type: "string",
            required: true,
            visible: "web",
            description: "File that has the source; the submitted one",
        },
        {
            key: "source",
            type: "string",
            required: true,
            eval: "C.object.name if C.object else ''",
            description: "Mesh whose data is carried over, or armature or collection: all meshes of it",
        },
        {
            key: "files",
            type: "string",
            required: true,
            visible: "submission",
            description: "Files of the characters that receive the data, with ; between them",
        },
        {
            key: "targets",
            type: "string",
            required: true,
            default: "*",
            description: "Meshes, armatures or collections in each file, with commas between them; * and ? stand for any letters",
        },
        {
            key: "kinds",
            type: "string",
            default: "",
            description: "What to carry, for example groups,uv; everything when empty",
        },
        {
            key: "output_folder",
            type: "string",
            subtype: "dir_path",
            required: true,
            description: "Where the results are saved, under the names of the files; older ones there are replaced",
        },
        {
            key: "keep_source",
            type: "bool",
            default: false,
            description: "Save the source in each file, too",
        },
        {
            key: "blender_cmd",
            type: "string",
            default: "{blender}",
            visible: "hidden",
        },
        {
            key: "blender_args",
            type: "string",
            default: "{blenderArgs}",
            visible: "hidden",
        },
    ],
};

function compileJob(job) {
    const settings = job.settings;
    const files = settings.files.split(";").map((file) => file.trim()).filter((file) => file);
    if (files.length === 0) {
        throw new Error("files: name at least one file");
    }
    const inputs = new Set([...files, settings.blendfile]);
    const outputs = new Set();
    for (const file of files) {
        const output = path.join(settings.output_folder, path.basename(file));
        if (inputs.has(output)) {
            throw new Error(`${output} is an input: choose another output_folder`);
        }
        if (outputs.has(output)) {
            throw new Error(`two files would be saved as ${output}: rename one or submit two jobs`);
        }
        outputs.add(output);
        job.addTask(authorTask(settings, file, output));
    }
}

function authorTask(settings, file, output) {
    const task = author.Task(`match-${path.stem(file)}`, "blender");
    const args = [
        "--command", "spectral_match", "batch",
        "--source", settings.source,
        "--source-file", settings.blendfile,
        "--target", settings.targets,
        "--output", output,
        "--json", `${output}.json`,
        // A task may be given out again; nothing but its own output is there by then.
        "--overwrite",
    ];
    if (settings.kinds) {
        args.push("--transfer", settings.kinds);
    }
    if (settings.keep_source) {
        args.push("--keep-source");
    }
    task.addCommand(
        author.Command("blender-render", {
            exe: settings.blender_cmd,
            exeArgs: settings.blender_args,
            argsBefore: [],
            blendfile: file,
            args: args,
        }),
    );
    return task;
}
