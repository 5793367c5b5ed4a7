# SPDX-License-Identifier: GPL-3.0-or-later
"""Refusals, notes, summaries and reasons in English, Japanese and Simplified Chinese.

`{}` is a name or a figure. In the translations `{0}`, `{1}` put them into another order.
"""

MESSAGES = (
    # Several meshes in one message.
    ("and {} more", "ほか {} 件", "等另外 {} 项"),
    ("{} and {} more", "{} ほか {} 件", "{} 等另外 {} 项"),
    ("{} (on {} targets)", "{}（転送先 {} 件）", "{}（{} 个目标）"),
    ("and {} more mesh", "ほかメッシュ {} 個", "及另外 {} 个网格"),
    ("and {} more meshes", "ほかメッシュ {} 個", "及另外 {} 个网格"),
    # Who is matched with whom.
    (
        "'{}' only shows a collection. Use Object > Apply > Make Instances Real, or select the meshes "
        "themselves",
        "'{}' はコレクションを表示しているだけです。「インスタンスを実体化」するか、メッシュ自体を選択し"
        "てください",
        "'{}' 只是显示一个集合。请使用“实例独立化”，或直接选择网格",
    ),
    (
        "'{}' has no meshes. Choose a mesh, or what holds some together",
        "'{}' にはメッシュがありません。メッシュか、それをまとめるものを選択してください",
        "'{}' 没有网格。请选择网格，或包含网格的物体",
    ),
    (
        "Source and target share one mesh, so they have the same data already",
        "転送元と転送先は同じメッシュを共有しており、データはすでに同じです",
        "来源与目标共用同一网格，数据已经相同",
    ),
    (
        "'{}' is in no scene: it was deleted, or only an instance shows it",
        "'{}' はどのシーンにもありません。削除されたか、インスタンスの表示だけです",
        "'{}' 不在任何场景中：已被删除，或仅由实例显示",
    ),
    (
        "Choose a source: the character that has the data",
        "転送元（データを持つキャラクター）を選択してください",
        "请选择来源：拥有数据的角色",
    ),
    (
        "Choose a target: another character, which receives the data",
        "転送先（データを受け取る別のキャラクター）を選択してください",
        "请选择目标：接收数据的另一个角色",
    ),
    ("Needs one source and one target", "転送元と転送先が 1 つずつ必要です", "需要一个来源和一个目标"),
    ("Choose one matched target", "マッチ済みの転送先を 1 つ選択してください", "请选择一个已匹配的目标"),
    (
        "'{}' is hidden or not selectable. Pin both objects to choose them by name",
        "'{}' は非表示か選択不可です。両方を固定すると名前で選べます",
        "'{}' 已隐藏或不可选。固定两者即可按名称选择",
    ),
    (
        "'{}' is not in this view layer. Pin both objects to choose them by name",
        "'{}' はこのビューレイヤーにありません。両方を固定すると名前で選べます",
        "'{}' 不在此视图层中。固定两者即可按名称选择",
    ),
    (
        "'{}' is no mesh of the chosen characters",
        "'{}' は選択したキャラクターのメッシュではありません",
        "'{}' 不是所选角色的网格",
    ),
    (
        "'{}' is no mesh of the chosen source",
        "'{}' は選択した転送元のメッシュではありません",
        "'{}' 不是所选来源的网格",
    ),
    (
        "'{}' is the last mesh of '{}' that takes part",
        "'{}' は '{}' で対象になっている最後のメッシュです",
        "'{}' 是 '{}' 中最后一个参与的网格",
    ),
    (
        "There is no object named '{}' any more",
        "'{}' という名前のオブジェクトはもうありません",
        "名为 '{}' 的物体已不存在",
    ),
    (
        "'{}' is in another scene. Link it to this one",
        "'{}' は別のシーンにあります。このシーンにリンクしてください",
        "'{}' 在另一场景中。请将其关联到此场景",
    ),
    # What can be matched.
    (
        "'{}' is not a mesh. Convert it to a mesh first",
        "'{}' はメッシュではありません。先にメッシュへ変換してください",
        "'{}' 不是网格。请先转换为网格",
    ),
    (
        "'{}' has no faces. Matching needs a surface",
        "'{}' には面がありません。マッチには面が必要です",
        "'{}' 没有面。匹配需要曲面",
    ),
    (
        "'{}' is linked from another file and cannot be written to. Use Object > Relations > Make Local > {}",
        "'{}' は別のファイルからのリンクで、書き込めません。「ローカル化」（{}）してください",
        "'{}' 关联自其他文件，无法写入。请将其“转为本地项”（{}）",
    ),
    ("Selected Objects and Data", "選択オブジェクトとデータ", "选定的物体及数据"),
    (
        "'{}' is a library override, which cannot store a match. "
        "Use Object > Relations > Make Local > Selected Objects and Data",
        "'{}' はライブラリオーバーライドなのでマッチを保存できません。「ローカル化」してください",
        "'{}' 是库重写，无法保存匹配。请将其“转为本地项”",
    ),
    (
        "'{}' is being sculpted with dynamic topology. Leave Sculpt Mode first",
        "'{}' はダイナミックトポロジーでスカルプト中です。先にスカルプトモードを終了してください",
        "'{}' 正在以动态拓扑雕刻。请先退出雕刻模式",
    ),
    (
        "'{}' is scaled to nothing along an axis. Give it a scale other than 0",
        "'{}' のスケールが 0 の軸があります。0 以外にしてください",
        "'{}' 在某轴上缩放为 0。请改为非 0 值",
    ),
    (
        "'{}' itself has a scale: its parent has none. Scale that",
        "'{}' 自体のスケールは正常で、親のスケールが 0 です。親を直してください",
        "'{}' 自身有缩放，其父级缩放为 0。请修改父级",
    ),
    (
        "'{}' was deleted or got another mesh while it was read. Match again",
        "'{}' は読み込み中に削除されたか、別のメッシュになりました。再マッチしてください",
        "'{}' 在读取时被删除或换了网格。请重新匹配",
    ),
    (
        "'{}' is morphed. Set Morph to 0 and match again",
        "'{}' はモーフ中です。モーフを 0 にして再マッチしてください",
        "'{}' 正处于变形中。请将变形设为 0 后重新匹配",
    ),
    (
        "'{}' is hidden in all viewports or not in this view layer. Show it, or set Shape to Original",
        "'{}' は全ビューポートで非表示か、このビューレイヤーにありません。表示するか、形状を「オリジナ"
        "ル」にしてください",
        "'{}' 在所有视图中隐藏或不在此视图层中。请显示它，或将形状设为“原始”",
    ),
    (
        "'{}' was deleted while the match was running. Undo, or match again",
        "'{}' はマッチ中に削除されました。元に戻すか、再マッチしてください",
        "'{}' 在匹配时被删除。请撤销或重新匹配",
    ),
    (
        "'{}' was edited while it was read. Match again",
        "'{}' は読み込み中に編集されました。再マッチしてください",
        "'{}' 在读取时被编辑。请重新匹配",
    ),
    (
        "A modifier of '{}' changes its vertices ({} modelled, {} shown), so a match could not be stored. "
        "Apply or switch off that modifier, or set Shape to Original",
        "'{}' のモディファイアーが頂点を変えるため（{} → {}）、マッチを保存できません。"
        "適用するかオフにする、または形状を「オリジナル」にしてください",
        "'{}' 的修改器改变了顶点（{} → {}），无法保存匹配。请应用或关闭该修改器，或将形状设为“原始”",
    ),
    (
        "'{}' got another mesh since it was read. Match again",
        "'{}' は読み込み後に別のメッシュになりました。再マッチしてください",
        "'{}' 在读取后换了网格。请重新匹配",
    ),
    (
        "'{}' was edited since it was read. Match again",
        "'{}' は読み込み後に編集されました。再マッチしてください",
        "'{}' 在读取后被编辑。请重新匹配",
    ),
    (
        "'{}' was edited since it was read. Fit it again",
        "'{}' は読み込み後に編集されました。もう一度合わせてください",
        "'{}' 在读取后被编辑。请重新适配",
    ),
    (
        "'{}' was edited since it was read. Match and fit again",
        "'{}' は読み込み後に編集されました。再マッチして合わせ直してください",
        "'{}' 在读取后被编辑。请重新匹配并适配",
    ),
    ("'{}' was not matched: {}", "'{}' はマッチできませんでした: {}", "'{}' 未能匹配：{}"),
    (
        "'{}' was left out: it shares the mesh of '{}'",
        "'{}' は '{}' とメッシュを共有するため除外されました",
        "'{}' 与 '{}' 共用网格，因此已排除",
    ),
    (
        "'{}' did not change to {} Mode. Change it by hand and try again",
        "'{}' を {} モードにできません。手動で切り替えてやり直してください",
        "'{}' 未能切换到 {} 模式。请手动切换后重试",
    ),
    (
        "'{}' has {} named '{}' and cannot get {} of the same name. Rename it and try again",
        "'{}' には {} '{}' があり、同名の{}を作れません。名前を変えてやり直してください",
        "'{}' 已有{} '{}'，无法再有同名的{}。请重命名后重试",
    ),
    ("a UV map", "UVマップ", "UV 贴图"),
    ("a color attribute", "カラー属性", "颜色属性"),
    ("an attribute", "属性", "属性"),
    ("a vertex group", "頂点グループ", "顶点组"),
    ("a built-in attribute", "組み込み属性", "内置属性"),
    (
        "What is worn may mislead the match: {}",
        "着用品がマッチを誤らせている可能性があります: {}",
        "穿戴物可能误导了匹配：{}",
    ),
    (
        "Nothing that takes part is worn over other meshes",
        "対象のメッシュに、他のメッシュの上に着ているものはありません",
        "参与的网格都没有穿在其他网格之上",
    ),
    # The stored match.
    (
        "A match is running. Wait for it, or press Esc to stop it",
        "マッチ実行中です。待つか、Esc で停止してください",
        "匹配正在进行。请等待，或按 Esc 停止",
    ),
    (
        "No outfit was fitted since the file was opened. Press Fit Outfit first",
        "ファイルを開いてから合わせた衣装がありません。先に「衣装を合わせる」を押してください",
        "打开文件后尚未适配服装。先按“适配服装”",
    ),
    (
        "Nothing is matched yet. Press Match first",
        "まだマッチがありません。先に「マッチ」を押してください",
        "尚无匹配。请先按“匹配”",
    ),
    ("Nothing is running", "実行中のものはありません", "没有正在进行的任务"),
    (
        "'{}' has no match yet. Press Match first",
        "'{}' はまだマッチされていません。先に「マッチ」を押してください",
        "'{}' 尚未匹配。请先按“匹配”",
    ),
    (
        "This came with map {}. To use map {}, press Transfer",
        "これはマップ {} の結果です。マップ {} を使うには「転送」を押します",
        "这是映射 {} 的结果。要使用映射 {}，请按“传递”",
    ),
    (
        "'{}' was matched with '{}': match again or choose that one as source",
        "'{}' は '{}' とマッチされています。再マッチするか、それを転送元にしてください",
        "'{}' 是与 '{}' 匹配的：请重新匹配，或选后者为来源",
    ),
    (
        "'{}' shares the mesh of '{}', so it has the same data already",
        "'{}' は '{}' とメッシュを共有し、データはすでに同じです",
        "'{}' 与 '{}' 共用网格，数据已经相同",
    ),
    (
        "The source '{}' is gone. Match again with another one",
        "転送元 '{}' がありません。別のものと再マッチしてください",
        "来源 '{}' 已不存在。请与其他来源重新匹配",
    ),
    (
        "'{}' got other vertices or faces since the match. Match again",
        "'{}' の頂点か面がマッチ後に変わりました。再マッチしてください",
        "'{}' 在匹配后更改了顶点或面。请重新匹配",
    ),
    (
        "Vertices of '{}' moved since the match. It is still used; match again to refresh it",
        "'{}' の頂点がマッチ後に動きました。マッチは有効です。更新するには再マッチします",
        "'{}' 的顶点在匹配后移动过。匹配仍可用；重新匹配可更新",
    ),
    (
        "The match of '{}' was removed from its attributes. Match again",
        "'{}' のマッチが属性から削除されました。再マッチしてください",
        "'{}' 的匹配已从属性中删除。请重新匹配",
    ),
    (
        "'{}' was matched as the whole that its Mirror modifier made of it, which it does no more. "
        "Match again",
        "'{}' はミラーモディファイアーで完成した形でマッチされましたが、今は違います。再マッチしてください",
        "'{}' 匹配时由镜像修改器补全，现已不再如此。请重新匹配",
    ),
    (
        "Other maps are not kept with a file or with a copy of the mesh. Match again to find them",
        "他のマップはファイルやメッシュのコピーに残りません。再マッチで見つけ直せます",
        "其他映射不随文件或网格副本保存。重新匹配即可找回",
    ),
    (
        "The match found no other plausible map. Add landmarks to steer it",
        "ほかに妥当なマップはありません。ランドマークを追加して誘導してください",
        "没有其他合理的映射。请添加标志点来引导",
    ),
    ("Map {} of {}: {}", "マップ {} / {}: {}", "映射 {} / {}：{}"),
    (
        "Cancelled; the map is the same as before",
        "キャンセルしました。マップは前と同じです",
        "已取消；映射与之前相同",
    ),
    (
        "Match stopped; nothing was changed",
        "マッチを停止しました。変更はありません",
        "匹配已停止；未作任何更改",
    ),
    (
        "Fitting stopped; nothing was changed",
        "衣装合わせを停止しました。変更はありません",
        "适配已停止；未作任何更改",
    ),
    ("Stopped.", "停止しました。", "已停止。"),
    ("Matched {} in {} s: {}", "{} をマッチしました（{} 秒）: {}", "已匹配 {}，用时 {} 秒：{}"),
    (
        "Matched {} in {} s, confidence {}: {}",
        "{} をマッチしました（{} 秒、信頼度 {}）: {}",
        "已匹配 {}，用时 {} 秒，置信度 {}：{}",
    ),
    ("{}, left and right swapped", "{}（左右を交換）", "{}（左右已交换）"),
    ("Matched {} of {} meshes", "メッシュ {1} 個中 {0} 個をマッチしました", "已匹配 {1} 个网格中的 {0} 个"),
    (
        "Matched {} of {} characters",
        "キャラクター {1} 体中 {0} 体をマッチしました",
        "已匹配 {1} 个角色中的 {0} 个",
    ),
    (
        "Matched and transferred to {} of {} meshes",
        "メッシュ {1} 個中 {0} 個にマッチして転送しました",
        "已匹配并传递给 {1} 个网格中的 {0} 个",
    ),
    (
        "Matched and transferred to {} of {} characters",
        "キャラクター {1} 体中 {0} 体にマッチして転送しました",
        "已匹配并传递给 {1} 个角色中的 {0} 个",
    ),
    # Landmarks.
    (
        "Landmark '{}' is on '{}', which is left out. Check '{}' under Pieces, or remove the landmark "
        "under Fix",
        "ランドマーク '{}' のある '{}' は除外されています。「パーツ」で '{}' をチェックするか、「修正」"
        "で削除してください",
        "标志点 '{}' 所在的 '{}' 已被排除。请在“部件”中勾选 '{}'，或在“修正”中移除标志点",
    ),
    (
        "'{}' got other vertices since landmark '{}' was picked. Remove the landmark under Fix, or pick "
        "it again",
        "'{}' の頂点がランドマーク '{}' の指定後に変わりました。「修正」で削除するか、指定し直してください",
        "'{}' 在设置标志点 '{}' 后更改了顶点。请在“修正”中移除，或重新选取",
    ),
    (
        "Landmark '{}' is there already. Click another point",
        "そこにはランドマーク '{}' があります。別の点をクリックしてください",
        "此处已有标志点 '{}'。请点击另一点",
    ),
    ("Choose a landmark in the list", "リストのランドマークを選択してください", "请在列表中选择标志点"),
    (
        "'{}' has {} vertices, so there is no vertex {}",
        "'{}' の頂点は {} 個で、頂点 {} はありません",
        "'{}' 只有 {} 个顶点，没有顶点 {}",
    ),
    (
        "'{}' has no mesh named '{}' that takes part",
        "'{}' の対象メッシュに '{}' はありません",
        "'{}' 的参与网格中没有 '{}'",
    ),
    (
        "Modifiers show '{}' far from its mesh and with other vertices. Switch them off in the viewport "
        "to pick points",
        "モディファイアーにより '{}' の表示がメッシュから離れています。点を選ぶにはビューポートでオフに"
        "してください",
        "修改器使 '{}' 的显示远离其网格且顶点不同。选点前请在视图中关闭修改器",
    ),
    (
        "Already picking. Click in the viewport, or press Esc to end",
        "指定中です。ビューポートをクリックするか、Esc で終了します",
        "正在选点。请在视图中点击，或按 Esc 结束",
    ),
    (
        "Landmarks are picked in the window; scripts can call add_landmark",
        "ランドマークはウィンドウで指定します。スクリプトでは add_landmark を使います",
        "标志点在窗口中选取；脚本可调用 add_landmark",
    ),
    (
        "Landmarks are being picked. Press Esc to end that",
        "ランドマークを指定中です。Esc で終了してください",
        "正在选取标志点。请按 Esc 结束",
    ),
    (
        "'{}' is in {} Mode. Use Object Mode first",
        "'{}' は {} モードです。先にオブジェクトモードにしてください",
        "'{}' 处于 {} 模式。请先切换到物体模式",
    ),
    (
        "Show both meshes in the viewport first",
        "先に両方のメッシュをビューポートに表示してください",
        "请先在视图中显示两个网格",
    ),
    ("Use this in a 3D viewport", "3Dビューポートで使ってください", "请在 3D 视图中使用"),
    ("Points are shown in the window alone", "点はウィンドウでのみ表示されます", "点只在窗口中显示"),
    ("Rest the pointer on a character", "キャラクターの上にポインターを置いてください", "请将指针停在角色上"),
    ("Take Back", "取り消し", "撤回"),
    ("Take Back Landmark", "ランドマークを取り消し", "撤回标志点"),
    ("1 landmark added", "ランドマークを 1 個追加しました", "已添加 1 个标志点"),
    ("{} landmarks added", "ランドマークを {} 個追加しました", "已添加 {} 个标志点"),
    # Settings.
    (
        "The preset '{}' comes with the extension and stays",
        "プリセット '{}' はエクステンションに付属するため残ります",
        "预设 '{}' 随扩展提供，予以保留",
    ),
    (
        "Settings of match and transfer are the defaults again",
        "マッチと転送の設定を初期値に戻しました",
        "匹配与传递的设置已恢复默认",
    ),
    (
        "{} MB freed; no prepared meshes are left in {}",
        "{} MB を解放し、{} の準備済みメッシュを消去しました",
        "已释放 {} MB，{} 中的预处理网格已清空",
    ),
    (
        "No meshes are kept on disk: Keep Prepared Meshes is off",
        "「準備済みメッシュを保存」がオフなので、何も保存されていません",
        "“保留预处理网格”已关闭，磁盘上没有网格",
    ),
    ("The cache cannot be cleared: {}", "キャッシュを消去できません: {}", "无法清除缓存：{}"),
    (
        "The computing core of Spectral Match does not load here ({}). Install the zip made for this "
        "operating system "
        "and restart Blender",
        "計算コアを読み込めません（{}）。この OS 用の zip をインストールして Blender を再起動してください",
        "计算核心无法加载（{}）。请安装适用于此操作系统的 zip 并重启 Blender",
    ),
    (
        "The match stopped with an unexpected error ({}: {}). Please report it",
        "予期しないエラーで停止しました（{}: {}）。報告をお願いします",
        "因意外错误而停止（{}：{}）。请报告此问题",
    ),
    # Transfer.
    (
        "Transfer stopped; nothing was changed",
        "転送を停止しました。変更はありません",
        "传递已停止；未作任何更改",
    ),
    (
        "There is no kind of data named {}. There are: {}",
        "{} という種類はありません。あるのは: {}",
        "没有名为 {} 的数据种类。可用：{}",
    ),
    ("'{}' does not have {}", "'{}' に {} はありません", "'{}' 没有 {}"),
    (
        "Nothing was carried from '{}' to '{}': {}",
        "'{}' から '{}' へは何も転送されませんでした: {}",
        "未从 '{}' 向 '{}' 传递任何数据：{}",
    ),
    (
        "'{}' is completed by a Mirror modifier, and the map knows its modelled half alone. Objects of "
        "the other half "
        "may lie beside it: apply the modifier and match again, or symmetrize them",
        "'{}' はミラーモディファイアーで完成し、マップは片側だけです。反対側のオブジェクトはずれる"
        "ことがあります。モディファイアーを適用して再マッチするか、対称化してください",
        "'{}' 由镜像修改器补全，映射只含建模的一半。另一半的物体可能错位："
        "请应用修改器后重新匹配，或将其对称化",
    ),
    (
        "'{}' brings both a vertex group and an attribute named '{}', which '{}' cannot get at once. "
        "Rename one of the two",
        "'{}' には頂点グループと属性の両方に '{}' があり、'{}' は同時に受け取れません。一方の名前を変え"
        "てください",
        "'{}' 的顶点组与属性同名 '{}'，'{}' 无法同时接收。请重命名其一",
    ),
    (
        "{} locked vertex groups of '{}' were left as they are",
        "'{1}' のロックされた頂点グループ {0} 個はそのままです",
        "'{1}' 的 {0} 个锁定顶点组保持不变",
    ),
    (
        "{} vertices of '{}' had no sure match and got the weights of their neighbors. The attribute {} "
        "marks them",
        "'{1}' の頂点 {0} 個は対応が不確実なため、周囲のウェイトを使いました。属性 {2} が示します",
        "'{1}' 的 {0} 个顶点没有可靠的对应，使用了邻近顶点的权重。属性 {2} 标出它们",
    ),
    (
        "'{}' keeps its rig '{}'. Weights went to bones at the same places: {}",
        "'{}' は自身のリグ '{}' を維持します。同じ箇所のボーンへウェイトを移しました: {}",
        "'{}' 保留其绑定 '{}'。权重已移至相同部位的骨骼：{}",
    ),
    (
        "The old weights of '{}' stay beside the new ones, in groups of their own: {}",
        "'{}' の元のウェイトは、新しいものとは別のグループに残しました: {}",
        "'{}' 的原有权重保留在单独的顶点组中，与新权重并存：{}",
    ),
    (
        "'{}' has no vertex group '{}' for the mask. Choose another one or none",
        "'{}' にマスク用の頂点グループ '{}' がありません。別のものか「なし」にしてください",
        "'{}' 没有用作遮罩的顶点组 '{}'。请另选或不选",
    ),
    (
        "Weights of other bones gave way at {} vertices of '{}': {}. Lock groups that shall stay as they are",
        "'{1}' の頂点 {0} 個で他のボーンのウェイトを減らしました: {2}。変えたくないグループはロックして"
        "ください",
        "'{1}' 的 {0} 个顶点处已降低其他骨骼的权重：{2}。需要保持不变的组请锁定",
    ),
    (
        "Weights of {} vertices of '{}' sum to more than 1, because groups of other bones move them "
        "too: {}. "
        "Remove these groups, or lock those that shall stay and transfer again",
        "'{1}' の頂点 {0} 個のウェイト合計が 1 を超えます。他のボーンのグループも動かすためです: {2}。"
        "それらを削除するか、残すものをロックして再転送してください",
        "'{1}' 的 {0} 个顶点权重之和大于 1，因为其他骨骼的组也在影响它们：{2}。请移除这些组，或锁定要保留的"
        "组后再次传递",
    ),
    (
        "Mirror Names found no other side for these names, which stay: {}. Rename those that are of one side",
        "「名前を左右反転」で反対側の名前が見つからず、そのままにしました: {}。片側のものは名前を変えて"
        "ください",
        "“镜像名称”未找到这些名称的另一侧，保持不变：{}。若属于一侧，请重命名",
    ),
    (
        "Masks of shape keys need groups that '{}' lacks: {}. Carry these groups too",
        "シェイプキーのマスクに必要なグループが '{}' にありません: {}。そのグループも転送してください",
        "形态键的遮罩需要 '{}' 缺少的顶点组：{}。请一并传递这些组",
    ),
    (
        "The shape keys of '{}' are absolute; only relative ones can be carried, and only beside "
        "relative ones. "
        "Check Relative in its Shape Keys panel",
        "'{}' のシェイプキーは絶対キーです。転送できるのは相対キー同士だけです。シェイプキーパネル"
        "で「相対」をオンにしてください",
        "'{}' 的形态键是绝对的；只能在相对形态键之间传递。请在形态键面板中勾选“相对”",
    ),
    (
        "{} shape keys move nothing on '{}' and were left out: {}",
        "シェイプキー {0} 個は '{1}' で何も動かさないため除外しました: {2}",
        "{0} 个形态键在 '{1}' 上无变化，已排除：{2}",
    ),
    (
        "1 shape key moves nothing on '{}' and was left out: {}",
        "シェイプキー 1 個は '{}' で何も動かさないため除外しました: {}",
        "1 个形态键在 '{}' 上无变化，已排除：{}",
    ),
    (
        "Faces of '{}' show materials of '{}'. Its own stay in its slots, and the attribute {} tells "
        "which face had which",
        "'{}' の面は '{}' のマテリアルになりました。元のマテリアルはスロットに残り、属性 {} に面ごとの番"
        "号があります",
        "'{}' 的面现使用 '{}' 的材质。原有材质仍在槽中，属性 {} 记录各面原先的材质",
    ),
    # UV maps and textures.
    ("UV map '{}' on '{}'", "'{1}' の UVマップ '{0}'", "'{1}' 的 UV 贴图 '{0}'"),
    (
        "{} is stretched {} times as much as on the source",
        "{} の伸びが転送元の {} 倍です",
        "{} 的拉伸是来源的 {} 倍",
    ),
    (
        "{} has {} flipped area (source {})",
        "{} の {} が裏返っています（転送元 {}）",
        "{} 有 {} 的面积翻转（来源 {}）",
    ),
    (
        "{} has {} overlapping area (source {})",
        "{} の {} が重なっています（転送元 {}）",
        "{} 有 {} 的面积重叠（来源 {}）",
    ),
    (
        "UV map '{}' of '{}' stays; that of '{}' came beside it as '{}'",
        "'{1}' の UVマップ '{0}' はそのままで、'{2}' のものを '{3}' として追加しました",
        "'{1}' 的 UV 贴图 '{0}' 保留；'{2}' 的贴图以 '{3}' 并列添加",
    ),
    (
        "'{}' has room for {} more UV maps only; {} are the most there can be. Remove one",
        "'{}' に追加できる UVマップはあと {} 個です（最大 {}）。1 つ削除してください",
        "'{}' 只能再添加 {} 个 UV 贴图（最多 {} 个）。请移除一个",
    ),
    (
        "UV map '{}' of '{}' has {} of the surface in single points, which show one texel each. Unwrap anew",
        "'{1}' の UVマップ '{0}' では面の {2} が 1 点にあり、1 テクセルしか表示しません。"
        "展開し直してください",
        "'{1}' 的 UV 贴图 '{0}' 中 {2} 的表面位于单个点上，只显示一个纹素。请重新展开",
    ),
    (
        "Parts of '{}' share {} of UV map '{}', and look alike there",
        "'{0}' の UVマップ '{2}' は {1} が重複していますが、そこは同じ見た目です",
        "'{0}' 的 UV 贴图 '{2}' 有 {1} 被共用，该处外观一致",
    ),
    (
        "Textures of '{}' were baked into a new UV map, '{}'. {}",
        "'{}' のテクスチャを新しい UVマップ '{}' にベイクしました。{}",
        "'{}' 的纹理已烘焙到新的 UV 贴图 '{}'。{}",
    ),
    (
        "Textures of '{}' were baked into a new UV map, '{}'.",
        "'{}' のテクスチャを新しい UVマップ '{}' にベイクしました。",
        "'{}' 的纹理已烘焙到新的 UV 贴图 '{}'。",
    ),
    (
        "In '{}', {} of it would show what belongs elsewhere",
        "'{0}' では {1} が別の場所の絵になるためです",
        "若用 '{0}'，其 {1} 会显示别处的内容",
    ),
    (
        "'{}' could not be unwrapped. Unwrap it by hand and transfer again",
        "'{}' を展開できません。手動で展開して再転送してください",
        "无法展开 '{}'。请手动展开后再次传递",
    ),
    (
        "'{}' has no room for one more UV map. Remove one",
        "'{}' に UVマップを追加できません。1 つ削除してください",
        "'{}' 无法再添加 UV 贴图。请移除一个",
    ),
    (
        "UV map '{}' of mesh '{}' has places that are no numbers. Unwrap it anew",
        "メッシュ '{1}' の UVマップ '{0}' に数値でない箇所があります。展開し直してください",
        "网格 '{1}' 的 UV 贴图 '{0}' 含有非数值。请重新展开",
    ),
    (
        "UV map '{}' of '{}' overlaps: {} of it is used more than once, and shows the same texels "
        "there. That is right "
        "for halves that look alike. If others look wrong, unwrap anew",
        "'{1}' の UVマップ '{0}' が重なっています（{2} が重複）。左右同じ絵なら問題ありません。"
        "見た目がおかしければ展開し直してください",
        "'{1}' 的 UV 贴图 '{0}' 有重叠：{2} 被多次使用，显示相同纹素。左右相同时没有问题；若看起来"
        "不对，请重新展开",
    ),
    (
        "Materials of '{}' overlap in UV map '{}': each of them got images of its own ({})",
        "'{}' のマテリアルが UVマップ '{}' で重なるため、それぞれに画像を作りました（{}）",
        "'{}' 的材质在 UV 贴图 '{}' 中重叠：已分别生成图像（{}）",
    ),
    (
        "Faces of '{}' were split along seams: {} vertices now ({} before) and {} faces ({})",
        "'{}' の面をシームで分割しました: 頂点 {}（前 {}）、面 {}（前 {}）",
        "'{}' 的面已沿缝合边拆分：现有 {} 个顶点（之前 {}）和 {} 个面（之前 {}）",
    ),
    (
        "'{}' has a Multiresolution modifier, whose sculpt would be lost when faces are split at seams",
        "'{}' のマルチレゾのスカルプトは、シームで面を分割すると失われます",
        "'{}' 有多级精度修改器，沿缝合边拆分面会丢失其雕刻",
    ),
    (
        "{}. Apply it, or switch Split Faces at Seams off",
        "{}。適用するか、「シームで面を分割」をオフにしてください",
        "{}。请应用它，或关闭“沿缝合边拆分面”",
    ),
    (
        "{}: they were left whole, and textures are off where a seam runs through",
        "{}。分割しなかったため、シームの通る面ではテクスチャがずれます",
        "{}：因此未拆分，缝合边穿过处纹理会错位",
    ),
    (
        "Textures of '{}' are shown by the source's UV map, which they fit as they are: they were not baked. "
        "To bake them, unwrap it, or choose a UV map of its own",
        "'{}' は転送元の UVマップでそのままテクスチャを表示するため、ベイクしませんでした。ベイクするに"
        "は展開するか、自身の UVマップを選んでください",
        "'{}' 用来源的 UV 贴图直接显示纹理，未烘焙。如需烘焙，请展开它，或选择其自身的 UV 贴图",
    ),
    (
        "The materials of '{}' do not show what was baked from {}: use the baked images in them, or "
        "check Materials "
        "and transfer again",
        "'{}' のマテリアルは {} からベイクした画像を使っていません。画像を割り当てるか、「マテリアル」を"
        "チェックして再転送してください",
        "'{}' 的材质未显示由 {} 烘焙的图像：请在材质中使用，或勾选“材质”后再次传递",
    ),
    (
        "'{}' has no UV map '{}' to bake textures into. Choose another one",
        "'{}' にベイク先の UVマップ '{}' がありません。別のものを選んでください",
        "'{}' 没有用于烘焙的 UV 贴图 '{}'。请另选",
    ),
    (
        "'{}' has no UV map of its own to bake textures into. Unwrap it first",
        "'{}' にはベイク先となる自身の UVマップがありません。先に展開してください",
        "'{}' 没有自己的 UV 贴图可供烘焙。请先展开",
    ),
    (
        "UV map '{}' of '{}' reaches out of the tiles that an image can have, from 0 to {} across and 0 "
        "to {} up. "
        "Move its islands there",
        "'{1}' の UVマップ '{0}' が画像タイルの範囲（横 0–{2}、縦 0–{3}）を超えています。範囲内へ移動して"
        "ください",
        "'{1}' 的 UV 贴图 '{0}' 超出图像分块范围（横 0–{2}，纵 0–{3}）。请将孤岛移入",
    ),
    (
        "No face of '{}' shows image '{}': it was not baked",
        "'{}' に画像 '{}' を表示する面がないため、ベイクしませんでした",
        "'{}' 没有面显示图像 '{}'：未烘焙",
    ),
    (
        "'{}' has faces with more than {} corners, which have no tangents. Triangulate them to bake a "
        "normal map",
        "'{}' に頂点が {} 個を超える面があり、接線がありません。ノーマルマップのベイクには三角面化"
        "してください",
        "'{}' 有超过 {} 个角的面，没有切线。烘焙法线贴图前请三角化",
    ),
    ("Image '{}' cannot be baked: {}", "画像 '{}' をベイクできません: {}", "无法烘焙图像 '{}'：{}"),
    (
        "Image '{}' of material '{}' holds normals",
        "マテリアル '{1}' の画像 '{0}' は法線です",
        "材质 '{1}' 的图像 '{0}' 含法线",
    ),
    (
        "Image '{}' of material '{}' is laid on {} (node '{}'), which cannot be baked. Lay it on by a UV map",
        "マテリアル '{1}' の画像 '{0}' は{2}貼られており（ノード '{3}'）、ベイクできません。UVマップで貼っ"
        "てください",
        "材质 '{1}' 的图像 '{0}' {2}映射（节点 '{3}'），无法烘焙。请改用 UV 贴图映射",
    ),
    (
        "'{}' has no UV map, so its textures have no place on it",
        "'{}' に UVマップがなく、テクスチャの位置が決まりません",
        "'{}' 没有 UV 贴图，纹理无处可放",
    ),
    (
        "by '{}', which is no UV map of '{}',",
        "'{1}' の UVマップではない '{0}' で",
        "按 '{0}'（不是 '{1}' 的 UV 贴图）",
    ),
    ("by '{}', whose values are not fixed numbers", "値が固定でない '{}' で", "按数值不固定的 '{}' "),
    ("by {} of '{}'", "'{1}' の {0} で", "按 '{1}' 的 {0} "),
    (
        "with tangents of '{}', which is no UV map of '{}',",
        "'{1}' の UVマップではない '{0}' の接線で",
        "以 '{0}' 的切线（不是 '{1}' 的 UV 贴图）",
    ),
    ("by the fixed value of '{}'", "'{}' の固定値で", "按 '{}' 的固定值"),
    (
        "{} for nodes of different spaces ({}), which cannot be baked. Give each space an image",
        "{}が、異なる空間のノードに使われており（{}）、ベイクできません。空間ごとに画像を用意してください",
        "{}，用于不同空间的节点（{}），无法烘焙。请为每个空间单独提供图像",
    ),
    (
        "{} whose channels are exchanged on the way to node '{}', which cannot be baked. Exchange them "
        "in the image itself",
        "{}が、ノード '{}' までにチャンネルが入れ替わるためベイクできません。画像自体で入れ替えてください",
        "{}，其通道在到节点 '{}' 的途中被交换，无法烘焙。请在图像中交换",
    ),
    (
        "The tiles of image '{}' were changed and not saved. Save or pack the image first",
        "画像 '{}' のタイルの変更が未保存です。先に保存かパックしてください",
        "图像 '{}' 的分块已更改但未保存。请先保存或打包",
    ),
    (
        "Image '{}' has frames; only still images can be baked. Leave it out, or replace it with a "
        "still image",
        "画像 '{}' は連番か動画です。ベイクできるのは静止画だけです。除外するか静止画に替えてください",
        "图像 '{}' 含多帧；只能烘焙静态图像。请排除它，或换成静态图像",
    ),
    (
        "Image '{}' has no pixels. Find its file: File > External Data",
        "画像 '{}' にピクセルがありません。ファイルを探してください: ファイル > 外部データ",
        "图像 '{}' 没有像素。请查找其文件：文件 > 外部数据",
    ),
    (
        "{} '{}' is not at {}. Save the image, or find its file: File > External Data",
        "{} '{}' が {} にありません。画像を保存するか、ファイルを探してください: ファイル > 外部データ",
        "{} '{}' 不在 {}。请保存图像，或查找其文件：文件 > 外部数据",
    ),
    ("Tile {} of image", "画像のタイル {}", "图像的分块 {}"),
    # Rigs and what hangs on them.
    (
        "The rig '{}' of '{}' was replaced: it stays in the scene, hidden, with its Armature modifier off",
        "'{1}' のリグ '{0}' を置き換えました。元のリグは非表示で残り、アーマチュアモディファイアーはオフです",
        "'{1}' 的绑定 '{0}' 已被替换：它隐藏保留在场景中，骨架修改器已关闭",
    ),
    (
        "The old rig '{}' of '{}' still moves what was left out: {}. To bring that too, undo, check it "
        "under Pieces and match again",
        "除外したものは '{1}' の元のリグ '{0}' で動いたままです: {2}。含めるには、操作を元に戻し、"
        "「パーツ」でチェックして再マッチしてください",
        "'{1}' 的原有绑定 '{0}' 仍带动未参与的部分：{2}。如要一并带上，请撤销，在“部件”中勾选并重新匹配",
    ),
    (
        "'{}' has no bones. Add bones to it, or leave it unchecked",
        "'{}' にボーンがありません。追加するか、チェックを外してください",
        "'{}' 没有骨骼。请添加骨骼，或取消勾选",
    ),
    (
        "'{}' has other bones now, so '{}' got a new rig. '{}' stays in the scene without it: take over "
        "what you added "
        "there, then delete it",
        "'{}' のボーンが変わったため、'{}' に新しいリグを作りました。'{}' はシーンに残ります。追加したも"
        "のを移してから削除してください",
        "'{}' 的骨骼已改变，因此为 '{}' 建立了新绑定。'{}' 仍留在场景中：请先转移您添加的内容，再删除它",
    ),
    (
        "'{}' keeps its rig '{}': {} was not fitted",
        "'{}' は自身のリグ '{}' を維持し、{} は合わせていません",
        "'{}' 保留其绑定 '{}'：{} 未适配",
    ),
    (
        "These hung on the old rig and follow the new one now: {}",
        "元のリグに付いていたものは新しいリグに従います: {}",
        "原挂在旧绑定上的物体现跟随新绑定：{}",
    ),
    (
        "Metaballs, point clouds and particle hair cannot follow the target: {}",
        "メタボール、ポイントクラウド、パーティクルヘアーは転送先に合わせられません: {}",
        "融球、点云和粒子毛发无法跟随目标：{}",
    ),
    (
        "These constraints were not copied. They are off, would move the copies away, or need something "
        "that the target lacks: {}",
        "次のコンストレイントはコピーしていません。オフか、コピーを動かしてしまうか、転送先にないものを"
        "使います: {}",
        "以下约束未复制：已关闭、会移走副本，或需要目标没有的内容：{}",
    ),
    (
        "Modifiers have to be bound again on the copies: {}",
        "コピーのモディファイアーを再バインドしてください: {}",
        "副本上的修改器需要重新绑定：{}",
    ),
    (
        "'{}' lacks what these drivers need, so they were not copied: {}",
        "'{}' にないものを使うため、次のドライバーはコピーしていません: {}",
        "'{}' 缺少以下驱动器所需的内容，因此未复制：{}",
    ),
    (
        "'{}' lacks what these constraints and drivers need, so they were not copied: {}",
        "'{}' にないものを使うため、次のコンストレイントとドライバーはコピーしていません: {}",
        "'{}' 缺少以下约束和驱动器所需的内容，因此未复制：{}",
    ),
    (
        "Attribute '{}' is of another type on other meshes of the source: it is left out",
        "属性 '{}' は転送元の他のメッシュで型が異なるため除きました",
        "属性 '{}' 在来源其他网格上类型不同：已排除",
    ),
    (
        "The meshes of the source could not be joined at '{}'. Join a copy of them by hand and match "
        "with that",
        "転送元のメッシュを '{}' で統合できません。コピーを手動で統合し、それとマッチしてください",
        "来源的网格无法在 '{}' 处合并。请手动合并副本，并与其匹配",
    ),
    (
        "The meshes of the source could not be joined: {}",
        "転送元のメッシュを統合できません: {}",
        "来源的网格无法合并：{}",
    ),
    (
        "The roots of {} of {} strands of '{}' have no counterpart on '{}' and were put onto the "
        "nearest place that has one. "
        "Check or delete them",
        "'{2}' の毛 {1} 本中 {0} 本の根元は '{3}' に対応点がなく、最も近い箇所に置きました。確認か削除を"
        "してください",
        "'{2}' 的 {1} 根发股中有 {0} 根的根部在 '{3}' 上没有对应点，已放到最近处。请检查或删除",
    ),
    (
        "Strands of '{}' are attached by the UV map '{}', and '{}' has none. For hair nodes carry UV "
        "Maps, then Other Objects "
        "again",
        "'{}' の毛は UVマップ '{}' で付きますが、'{}' にありません。ヘアーノードには「UVマップ」、次に「"
        "その他のオブジェクト」を転送してください",
        "'{}' 的发股以 UV 贴图 '{}' 附着，而 '{}' 没有。毛发节点需先传递“UV 贴图”，再传递“其他物体”",
    ),
    (
        "'{}' has no UV map '{}': strands of '{}' are attached by '{}'",
        "'{}' に UVマップ '{}' がないため、'{}' の毛は '{}' で付けました",
        "'{}' 没有 UV 贴图 '{}'：'{}' 的发股以 '{}' 附着",
    ),
    (
        "UV map '{}' of '{}' has places that are no numbers, by which strands of '{}' cannot be "
        "attached. Unwrap it anew",
        "'{1}' の UVマップ '{0}' に数値でない箇所があり、'{2}' の毛を付けられません。展開し直してください",
        "'{1}' 的 UV 贴图 '{0}' 含有非数值，'{2}' 的发股无法附着。请重新展开",
    ),
    (
        "UV map '{}' of '{}' has {} overlapping area, where hair nodes leave strands of '{}' as they are. "
        "Attach them by another one",
        "'{1}' の UVマップ '{0}' は {2} が重なり、そこでは '{3}' の毛が動きません。別の UVマップで付けて"
        "ください",
        "'{1}' 的 UV 贴图 '{0}' 有 {2} 的面积重叠，毛发节点在该处不会移动 '{3}' 的发股。请改用另一贴图附着",
    ),
    (
        "{} of {} strands of '{}' stand on other meshes than '{}', to which hair nodes attach all of them",
        "'{2}' の毛 {1} 本中 {0} 本は '{3}' 以外のメッシュにありますが、ヘアーノードはすべてを '{3}' に"
        "付けます",
        "'{2}' 的 {1} 根发股中有 {0} 根位于 '{3}' 以外的网格，而毛发节点会将其全部附着到 '{3}'",
    ),
    # Fit Outfit.
    (
        "'{}' has no body: the outfit was fitted by what it covers",
        "'{}' には体がないため、衣装は覆う部分に合わせました",
        "'{}' 没有身体：服装按其覆盖的部分适配",
    ),
    (
        "'{}' is one mesh. Separate its clothes into objects of their own: select their faces in Edit "
        "Mode and press P",
        "'{}' は 1 つのメッシュです。編集モードで衣装の面を選択し、P キーで別オブジェクトに分離してください",
        "'{}' 是单一网格。请将衣物分离为独立物体：在编辑模式中选中其面并按 P",
    ),
    (
        "Nothing that '{}' wears is checked",
        "'{}' の着ているものがチェックされていません",
        "'{}' 的穿着均未勾选",
    ),
    (
        "The outfit was not fitted to '{}': {}",
        "衣装を '{}' に合わせられませんでした: {}",
        "服装未能适配到 '{}'：{}",
    ),
    (
        "'{}' wears clothes of its own there. Hide what is in the way:",
        "'{}' はそこに自分の服を着ています。邪魔なものを隠してください:",
        "'{}' 在该处穿着自己的衣服。请隐藏碍事的部分：",
    ),
    ("Fitting the outfit", "衣装を合わせています", "正在适配服装"),
    ("nothing is inside the body", "体の内側に入った箇所はありません", "没有穿入身体之处"),
    (
        "{} of {} vertices ({} %) are inside the body",
        "頂点 {1} 個中 {0} 個（{2} %）が体の内側です",
        "{1} 个顶点中有 {0} 个（{2} %）位于身体内",
    ),
    ("Fitted {} garments to {}: {}", "衣装 {} 点を {} に合わせました: {}", "已将 {} 件服装适配到 {}：{}"),
    ("Fitted 1 garment to {}: {}", "衣装 1 点を {} に合わせました: {}", "已将 1 件服装适配到 {}：{}"),
    (
        "'{}' was matched with '{}', which is not of '{}'. Match again",
        "'{}' は '{2}' のものではない '{1}' とマッチされています。再マッチしてください",
        "'{0}' 是与 '{1}' 匹配的，后者不属于 '{2}'。请重新匹配",
    ),
    (
        "There is no skin under '{}': what lies over it was fitted to its surface",
        "'{}' の下に肌がないため、上のものはその表面に合わせました",
        "'{}' 下没有皮肤：其上的物体已适配到它的表面",
    ),
    (
        "'{}' got bones that move the outfit: {}",
        "'{}' に衣装を動かすボーンを追加しました: {}",
        "已为 '{}' 添加带动服装的骨骼：{}",
    ),
    (
        "'{}' is linked or an override and takes no bones: what these move follows the bones above them: {}",
        "'{}' はリンクかオーバーライドのためボーンを追加できません。これらが動かすものは親ボーンに従いま"
        "す: {}",
        "'{}' 是关联或重写，无法添加骨骼：其所驱动的部分跟随上级骨骼：{}",
    ),
    (
        "'{}' has an attribute named '{}': its skin was not hidden",
        "'{}' に属性 '{}' があるため、肌を隠せませんでした",
        "'{}' 已有名为 '{}' 的属性：其皮肤未隐藏",
    ),
    # What the core says.
    ("source: {}", "転送元: {}", "来源：{}"),
    ("target: {}", "転送先: {}", "目标：{}"),
    (
        "the mesh has no surface ({} vertices, {} faces, none with an area): give a mesh with triangles",
        "メッシュに面積がありません（頂点 {}、面 {}）。面のあるメッシュが必要です",
        "网格没有面积（{} 个顶点，{} 个面）。需要有面的网格",
    ),
    (
        "vertex {} has a coordinate that is not finite: remove or repair that vertex",
        "頂点 {} の座標が有限の数ではありません。削除するか直してください",
        "顶点 {} 的坐标不是有限数。请删除或修复",
    ),
    (
        "face {} refers to vertex {}, but there are {} vertices (0 to {}): repair the face list",
        "面 {} の頂点 {} は存在しません（頂点数 {}、0–{}）。面を直してください",
        "面 {} 引用了不存在的顶点 {}（共 {} 个，0–{}）。请修复面",
    ),
    (
        "the largest connected part has {} vertices, at least {} are needed: join loose parts by "
        "merging vertices "
        "at the same place, or subdivide",
        "最大のつながった部分の頂点は {} 個で、{} 個以上必要です。分離した部分を統合するか、細分化してく"
        "ださい",
        "最大的相连部分只有 {} 个顶点，至少需要 {} 个。请合并散块或细分",
    ),
    (
        "the Laplace operator could not be factorised ({}): merge vertices that lie on top of each "
        "other and dissolve "
        "needle triangles",
        "表面を計算できません（{}）。重なった頂点を統合し、針状の三角形を溶解してください",
        "无法计算曲面（{}）。请合并重叠的顶点并融并针状三角面",
    ),
    (
        "the distances on a surface could not be expressed in its eigenfunctions ({}): merge vertices that "
        "lie on top of each other and dissolve needle triangles",
        "表面上の距離を計算できません（{}）。重なった頂点を統合し、針状の三角形を溶解してください",
        "无法计算曲面上的距离（{}）。请合并重叠的顶点并融并针状三角面",
    ),
    (
        "no map could be fitted to the points that were matched ({}): set landmarks, or say which shape is a "
        "part of the other",
        "対応した点からマップを作れません（{}）。ランドマークを置くか、どちらが部分かを指定してください",
        "无法由匹配的点得到映射（{}）。请设置标志点，或指明哪一个是另一个的局部",
    ),
    (
        "one surface could not be drawn onto the other ({}): merge vertices that lie on top of each other "
        "and dissolve needle triangles",
        "一方の表面を他方に合わせられません（{}）。重なった頂点を統合し、針状の三角形を溶解してください",
        "无法将一个曲面贴合到另一个（{}）。请合并重叠的顶点并融并针状三角面",
    ),
    (
        "values could not be filled in where none were carried ({}): merge vertices that lie on top of each "
        "other and dissolve needle triangles",
        "転送されなかった部分の値を補えません（{}）。重なった頂点を統合し、針状の三角形を溶解してください",
        "无法补全未传递处的值（{}）。请合并重叠的顶点并融并针状三角面",
    ),
    (
        "the garment could not be fitted ({}): merge vertices that lie on top of each other and dissolve "
        "needle triangles",
        "衣装を合わせられません（{}）。重なった頂点を統合し、針状の三角形を溶解してください",
        "无法适配服装（{}）。请合并重叠的顶点并融并针状三角面",
    ),
    (
        "the equations could not be set up ({}): close other programs, or simplify the mesh",
        "計算の準備ができません（{}）。ほかのプログラムを終了するか、メッシュを簡略化してください",
        "无法建立方程（{}）。请关闭其他程序，或简化网格",
    ),
    (
        "the surface could not be measured ({}): merge vertices that lie on top of each other and dissolve "
        "needle triangles",
        "表面を計測できません（{}）。重なった頂点を統合し、針状の三角形を溶解してください",
        "无法测量曲面（{}）。请合并重叠的顶点并融并针状三角面",
    ),
    (
        "the distances on a surface could not be measured ({}): merge vertices that lie on top of each other "
        "and dissolve needle triangles",
        "表面上の距離を計測できません（{}）。重なった頂点を統合し、針状の三角形を溶解してください",
        "无法测量曲面上的距离（{}）。请合并重叠的顶点并融并针状三角面",
    ),
    (
        "there was no room for the computation ({}): close other programs, or simplify the mesh",
        "計算のためのメモリがありません（{}）。ほかのプログラムを終了するか、メッシュを簡略化してください",
        "没有足够的内存进行计算（{}）。请关闭其他程序，或简化网格",
    ),
    (
        "the shape could not be measured: clean up needle triangles",
        "形を計測できません。針状の三角形を整理してください",
        "无法测量形状。请清理针状三角面",
    ),
    (
        "each map found is mirrored. If one shape is a mirror image of the other, allow mirrored maps",
        "見つかったマップはすべて鏡像です。鏡像同士なら「ミラーマッチを許可」してください",
        "找到的映射都是镜像；若互为镜像，请允许镜像匹配",
    ),
    (
        "no map holds together. Check scale and holes of the meshes",
        "整合するマップがありません。メッシュのスケールと穴を確認してください",
        "没有连贯的映射。请检查网格的缩放和孔洞",
    ),
    (
        "no map was convincing. Add landmarks on hands, feet and head",
        "確かなマップがありません。手・足・頭にランドマークを追加してください",
        "没有可信的映射。请在手、脚和头上添加标志点",
    ),
    (
        "a vertex has a coordinate that is not finite: remove or repair it",
        "座標が有限の数でない頂点があります。削除するか直してください",
        "有顶点的坐标不是有限数。请删除或修复",
    ),
    (
        "a face has a vertex that is not there: repair the mesh",
        "存在しない頂点を持つ面があります。メッシュを直してください",
        "有面引用了不存在的顶点。请修复网格",
    ),
    (
        "{} of {} eigenpairs converged (largest residual {}): ask for fewer, or clean up needle triangles",
        "表面の計算が収束しません（{} / {}、残差 {}）。針状の三角形を整理してください",
        "曲面计算未收敛（{} / {}，残差 {}）。请清理针状三角面",
    ),
    (
        "the map was not refined on what the part covers alone: there {}",
        "部分が覆う範囲でのマップの調整はできませんでした: {}",
        "未能在局部覆盖范围内细化映射：{}",
    ),
    ("no plausible map was found: {}", "妥当なマップが見つかりません: {}", "未找到合理的映射：{}"),
    (
        "every candidate is mirrored; if one shape is a mirror image, allow that",
        "候補はすべて鏡像です。鏡像同士なら「ミラーマッチを許可」してください",
        "所有候选都是镜像；若互为镜像，请允许镜像匹配",
    ),
    (
        "no candidate has a finite distortion; check the shapes' scale and holes",
        "どの候補も歪みが計算できません。スケールと穴を確認してください",
        "没有候选具有有限的变形；请检查缩放和孔洞",
    ),
    ("no candidate stood in the vote", "残った候補がありません", "没有候选通过表决"),
    ("distances, curvatures and orientation agree", "距離・曲率・向きが一致", "距离、曲率和朝向一致"),
    (
        "not all that was compared agrees, but together it says that the map is right ({} %)",
        "一致しない点もありますが、全体としては正しいマップです（{} %）",
        "部分比较不一致，但综合来看映射正确（{} %）",
    ),
    (
        "this method does not judge its map: look at it",
        "この手法はマップを評価しません。目で確認してください",
        "此方法不评判映射：请查看",
    ),
    (
        "one shape looks like a mirror image of the other: allow mirrored maps",
        "一方が他方の鏡像のようです: ミラーマッチを許可",
        "两者互为镜像：请允许镜像匹配",
    ),
    (
        "another map fits better: this is an alternative",
        "より合うマップがあります: これは比較用です",
        "另有更合适的映射：此项仅供比较",
    ),
    (
        "another map fits better: this is one to compare",
        "より合うマップがあります: これは比較用です",
        "另有更合适的映射：此项仅供比较",
    ),
    (
        "other maps fit almost as well: compare the alternatives or set a landmark",
        "他のマップも同程度に合います: 比べるか、ランドマークを設定",
        "其他映射几乎同样合适：请比较或设置标志点",
    ),
    (
        "other maps fit almost as well: compare the maps or add landmarks",
        "他のマップも同程度に合います: 比べるか、ランドマークを設定",
        "其他映射几乎同样合适：请比较或设置标志点",
    ),
    (
        "bumps and hollows do not agree (correlation {}): the shapes may not match",
        "凹凸が一致しません（相関 {}）: 形が対応しない可能性",
        "凹凸不一致（相关 {}）：形状可能不对应",
    ),
    (
        "left and right are hard to tell apart (orientation {}): try the next alternative",
        "左右の区別が困難（向き {}）: 次のマップを試す",
        "左右难以分辨（朝向 {}）：请试下一映射",
    ),
    (
        "left and right are hard to tell apart (orientation {}): try the next map",
        "左右の区別が困難（向き {}）: 次のマップを試す",
        "左右难以分辨（朝向 {}）：请试下一映射",
    ),
    (
        "the surface turns in places (orientation {})",
        "面の向きが変わる箇所あり（向き {}）",
        "曲面有些位置转向（朝向 {}）",
    ),
    (
        "distances change by {} % of √area: the shapes differ, or one is a part",
        "距離の変化 {} %（√面積比）: 形が異なるか、一方が一部",
        "距离变化为 √面积的 {} %：形状不同，或一方是局部",
    ),
    (
        "distances change by {} % of √area: the bodies differ",
        "距離の変化 {} %（√面積比）: 体型が異なる",
        "距离变化为 √面积的 {} %：体型不同",
    ),
    (
        "neighbours on the target go to places far apart: limbs may have grown together where they touch",
        "転送先の隣り合う点が離れた場所に対応: 触れた手足がつながった可能性",
        "目标上相邻的点对应到相距很远之处：相接触的肢体可能粘连",
    ),
    (
        "the target lies on the source as it is worn: each point takes what lies below it",
        "転送元が転送先を着ています: 各点は真下の点に対応",
        "目标穿在来源身上：每个点对应其下方的点",
    ),
    (
        "both have the same pieces: each point takes the one that it is a copy of",
        "両者は同じパーツでできています: 各点は複製元の点に対応",
        "两者由相同的部件组成：每个点对应其所复制的点",
    ),
    (
        "{} % of what is seen was placed beside what was matched: look at it",
        "見える部分の {} % は隣から補いました: 確認してください",
        "可见部分的 {} % 由相邻处推得：请查看",
    ),
    (
        "the source has only {} vertices: too few to be sure, look at it",
        "転送元の頂点は {} 個のみ: 少なすぎるため確認してください",
        "来源只有 {} 个顶点：太少，请查看",
    ),
    (
        "the target has only {} vertices: too few to be sure, look at it",
        "転送先の頂点は {} 個のみ: 少なすぎるため確認してください",
        "目标只有 {} 个顶点：太少，请查看",
    ),
    (
        "the source looks the same when it is turned about an axis: which way round it goes cannot be "
        "told, set two landmarks a quarter turn apart",
        "転送元はある軸で回しても同じ形です: 向きが決まらないため、1/4 回転離れた 2 か所にランドマークを設定",
        "来源绕某轴旋转后形状不变：无法判断朝向，请在相隔四分之一圈的两处设置标志点",
    ),
    (
        "the target looks the same when it is turned about an axis: which way round it goes cannot be "
        "told, set two landmarks a quarter turn apart",
        "転送先はある軸で回しても同じ形です: 向きが決まらないため、1/4 回転離れた 2 か所にランドマークを設定",
        "目标绕某轴旋转后形状不变：无法判断朝向，请在相隔四分之一圈的两处设置标志点",
    ),
    (
        "the source's {} pieces were matched as one figure",
        "転送元のパーツ {} 個を 1 体としてマッチ",
        "来源的 {} 个部件作为一体匹配",
    ),
    (
        "the target's {} pieces were matched as one figure",
        "転送先のパーツ {} 個を 1 体としてマッチ",
        "目标的 {} 个部件作为一体匹配",
    ),
    (
        "one point of the source lies far out: it was taken to be between its neighbours",
        "転送元の遠く離れた点 1 個を、隣の点の間にあるものとしました",
        "来源有 1 个偏远的点：视为位于相邻点之间",
    ),
    (
        "{} points of the source lie far out: they were taken to be between their neighbours",
        "転送元の遠く離れた点 {} 個を、隣の点の間にあるものとしました",
        "来源有 {} 个偏远的点：视为位于相邻点之间",
    ),
    (
        "one point of the target lies far out: it was taken to be between its neighbours",
        "転送先の遠く離れた点 1 個を、隣の点の間にあるものとしました",
        "目标有 1 个偏远的点：视为位于相邻点之间",
    ),
    (
        "{} points of the target lie far out: they were taken to be between their neighbours",
        "転送先の遠く離れた点 {} 個を、隣の点の間にあるものとしました",
        "目标有 {} 个偏远的点：视为位于相邻点之间",
    ),
    (
        "one unconnected part of the source was left out ({} vertices)",
        "転送元の離れた部分 1 個を除外（頂点 {}）",
        "来源有 1 个分离部分被排除（{} 个顶点）",
    ),
    (
        "one unconnected part of the target was left out ({} vertices)",
        "転送先の離れた部分 1 個を除外（頂点 {}）",
        "目标有 1 个分离部分被排除（{} 个顶点）",
    ),
    (
        "{} unconnected parts of the source were left out ({} vertices)",
        "転送元の離れた部分 {} 個を除外（頂点 {}）",
        "来源有 {} 个分离部分被排除（{} 个顶点）",
    ),
    (
        "{} unconnected parts of the target were left out ({} vertices)",
        "転送先の離れた部分 {} 個を除外（頂点 {}）",
        "目标有 {} 个分离部分被排除（{} 个顶点）",
    ),
)
